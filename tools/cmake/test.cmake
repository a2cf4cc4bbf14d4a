# What pytest loads: optimised, with the tests' probe, installed in the layout of the Python package.
set(CMAKE_BUILD_TYPE Release CACHE STRING "")
set(HX_PROBE ON CACHE BOOL "")
set(HX_WHEEL ON CACHE BOOL "")
