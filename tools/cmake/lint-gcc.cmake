# gcc -std=c11 -Wpedantic and more, warnings are errors.
set(CMAKE_BUILD_TYPE Debug CACHE STRING "")
set(CMAKE_C_COMPILER gcc CACHE STRING "")
set(HX_LINT ON CACHE BOOL "")
set(HX_PROBE ON CACHE BOOL "")
set(HX_FMU ON CACHE BOOL "")
