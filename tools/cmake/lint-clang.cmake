# clang -std=c11 -Weverything but for a list with reasons (plant_fmu/cmake/warnings.cmake), warnings
# are errors.
set(CMAKE_C_COMPILER clang CACHE STRING "")
include(${CMAKE_CURRENT_LIST_DIR}/lint-gcc.cmake)
