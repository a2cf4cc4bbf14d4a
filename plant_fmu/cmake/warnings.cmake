# HX_WARNINGS: compiler warnings of every build. With HX_LINT warnings are errors, and clang enables
# all warnings except those listed here.
option(HX_LINT "Make warnings errors; with clang, have all but those in cmake/warnings.cmake" OFF)

if(MSVC)
  set(HX_WARNINGS /W4)
else()
  set(HX_WARNINGS -Wall -Wextra -Wpedantic -Wconversion -Wno-sign-conversion -Wshadow
    -Wstrict-prototypes -Wmissing-prototypes -Wvla
    -Werror=implicit-function-declaration) # else C takes the result for an int, whatever it is
  if(CMAKE_C_COMPILER_ID MATCHES "Clang")
    list(APPEND HX_WARNINGS
      -Wno-unknown-warning-option      # names that older compilers lack
      -Wno-enum-float-conversion       # sizes are enumerators, and a mean is a sum over a size
      -Wno-keyword-macro)              # src/tangent.c defines double as complex
  endif()
endif()

if(HX_LINT)
  list(APPEND HX_WARNINGS -Werror)
  if(CMAKE_C_COMPILER_ID MATCHES "Clang")
    list(APPEND HX_WARNINGS -Weverything
      # about other languages and standards: this is C11
      -Wno-declaration-after-statement # C89
      -Wno-pre-c11-compat              # C99
      -Wno-implicit-void-ptr-cast      # C++: calloc's result, as everywhere in C
      -Wno-default-const-init-var      # C++: a static constant of zeros
      -Wno-unsafe-buffer-usage         # C++ has spans instead of pointers
      -Wno-nrvo                        # C++: copies of what is returned
      # about conventions of this project
      -Wno-padded                      # structures are ordered for readers
      -Wno-comma                       # short assignments that belong together stand on one line
      -Wno-float-equal                 # compared values were assigned, not calculated; 0: none
      -Wno-anon-enum-enum-conversion   # products of sizes are enumerators, too
      # about correct code that cannot be written otherwise
      -Wno-conditional-uninitialized   # vectors that loops over constant bounds fill
      -Wno-double-promotion            # the C library's NAN and INFINITY are floats
      -Wno-cast-qual                   # fmi/arrays.c: one loop reads or writes values
      -Wno-disabled-macro-expansion    # FMI's headers define functions' names as themselves
      -Wno-used-but-marked-unused      # a header's function that not every file calls
      -Wno-shadow-header)              # each component has its own generated/variables.h
  endif()
endif()
