/* method.c - coefficients of the methods; models/method.py has the same ones */
#include "method.h"

#include <stddef.h>

#include "hexapod/hexapod.h"

static const hxMethodRow rows[] = {
    /* The coefficients nearest to ROS34PW2's (Rang and Angermann, BIT 45, 2005) that also meet the
     * condition of method.h: order 3(2) with any A_i, A- and L-stable with the exact Jacobian,
     * stiffly accurate. tools/rosw3.py computes them. */
    [HX_METHOD_ROSW3] =
        {.stages = 4,
         .order = 3,
         .gamma = 0.435866521508459,
         .a = {{0}, {0.8600765640643095}, {0.8279797393140516, -0.11004647855982283}, {0, 0, 1}},
         .g = {{0},
               {-0.8600765640643084},
               {-0.8859926672530537, 0.05043946654533214},
               {0.23418392804962088, -1.2153107048931744, 0.5452602553350947}},
         .c = {0, 0.8600765640643095, 0.7179332607542287, 1},
         .b = {0.23418392804962088, -1.2153107048931744, 1.5452602553350947, 0.435866521508459},
         .e = {-0.13692238301635248, -1.1228581716475137, 1.0424361172393994, 0.21734443742446677}},
    /* Verwer, Spee, Blom and Hundsdorfer, SIAM J. Sci. Comput. 20 (1999): order 2(1) with any A,
       L-stable; gamma = 1 - 1/sqrt(2) */
    [HX_METHOD_ROS2] = {.stages = 2,
                        .order = 2,
                        .gamma = 2.9289321881345248e-01,
                        .a = {{0}, {1}},
                        .g = {{0}, {-2 * 2.9289321881345248e-01}},
                        .c = {0, 1},
                        .b = {0.5, 0.5},
                        .e = {-0.5, 0.5}},
    /* Dormand and Prince, J. Comput. Appl. Math. 6 (1980) */
    [HX_METHOD_DP54] =
        {.stages = 7,
         .order = 5,
         .a = {{0},
               {1.0 / 5},
               {3.0 / 40, 9.0 / 40},
               {44.0 / 45, -56.0 / 15, 32.0 / 9},
               {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
               {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
               {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}},
         .c = {0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1, 1},
         .b = {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84, 0},
         .e = {71.0 / 57600, 0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525,
               -1.0 / 40}},
};

const hxMethodRow *hx_method(int method) {
  return method >= 1 && method < (int)(sizeof rows / sizeof rows[0]) ? &rows[method] : NULL;
}
