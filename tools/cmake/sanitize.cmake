# Address and undefined-behaviour sanitizers, with debug information.
include(${CMAKE_CURRENT_LIST_DIR}/test.cmake)
set(CMAKE_BUILD_TYPE Debug CACHE STRING "" FORCE)
set(CMAKE_C_FLAGS_DEBUG "-Og -g" CACHE STRING "")
set(CMAKE_C_FLAGS "-fsanitize=address,undefined,float-cast-overflow \
-fno-sanitize-recover=undefined,float-cast-overflow -fno-omit-frame-pointer" CACHE STRING "")
