# The targets of fuzz.cmake for AFL++, whose compiler has a driver for LLVMFuzzerTestOneInput.
set(CMAKE_C_COMPILER afl-clang-fast CACHE STRING "")
set(CMAKE_C_FLAGS "-fsanitize=address,undefined,float-cast-overflow \
-fno-sanitize-recover=undefined,float-cast-overflow -fno-omit-frame-pointer" CACHE STRING "")
include(${CMAKE_CURRENT_LIST_DIR}/fuzz.cmake)
