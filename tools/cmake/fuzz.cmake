# libFuzzer's targets (tests/fuzz), with address and undefined-behaviour sanitizers.
set(CMAKE_BUILD_TYPE Debug CACHE STRING "")
set(CMAKE_C_COMPILER clang CACHE STRING "")
set(CMAKE_C_FLAGS_DEBUG "-O1 -g" CACHE STRING "")
set(CMAKE_C_FLAGS "-fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow \
-fno-sanitize-recover=undefined,float-cast-overflow -fno-omit-frame-pointer" CACHE STRING "")
set(BUILD_TESTING OFF CACHE BOOL "")
set(HX_FUZZ ON CACHE BOOL "")
set(HX_FMU ON CACHE BOOL "")
