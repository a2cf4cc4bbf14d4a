# gcc's counters of executed branches: each function once (not where it is inlined), the baseline
# kernel alone.
include(${CMAKE_CURRENT_LIST_DIR}/test.cmake)
set(CMAKE_BUILD_TYPE Debug CACHE STRING "" FORCE)
set(CMAKE_C_COMPILER gcc CACHE STRING "")
set(CMAKE_C_FLAGS_DEBUG "-Og -g" CACHE STRING "")
set(CMAKE_C_FLAGS "--coverage -fno-inline -Dalways_inline=unused -DHX_BASELINE_ONLY" CACHE STRING "")
