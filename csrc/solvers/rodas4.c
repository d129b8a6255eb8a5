/* SPDX-License-Identifier: MIT
 *
 * "rodas4": RODAS of E. Hairer and G. Wanner, Solving ODEs II, IV.7, order 4(3), stiffly accurate,
 * L-stable, with its interpolant of order 3. Guarded by tests/test_implicit.py: order conditions,
 * observed order, dense output.
 */
#include "solvers/solvers.h"

static const double a[] = {
    1.544000000000000,   0.9466785280815826,  0.2557011698983284,
    3.314825187068521,   2.896124015972201,   0.9986419139977817,
    1.221224509226641,   6.019134481288629,   12.53708332932087,
    -0.6878860361058950, 1.221224509226641,   6.019134481288629,
    12.53708332932087,   -0.6878860361058950, 1.0,
};
static const double c[] = {
    -5.6688,
    -2.430093356833875,
    -0.2063599157091915,
    -0.1073529058151375,
    -9.594562251023355,
    -20.47028614809616,
    7.496443313967647,
    -10.24680431464352,
    -33.99990352819905,
    11.70890893206160,
    8.083246795921522,
    -7.981132988064893,
    -31.52159432874371,
    16.31930543123136,
    -6.058818238834054,
};
static const double time[] = {0.0, 0.386, 0.21, 0.63, 1.0, 1.0};
static const double slope[] = {0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0};
static const double d2[] = {10.12623508344586,  -7.487995877610167, -34.80091861555747,
                            -7.992771707568823, 1.025137723295662,  0.0};
static const double d3[] = {-0.6762803392801253, 6.087714651680015,  16.43084320892478,
                            24.76722511418386,   -6.594389125716872, 0.0};

static const bd_rosenbrock coefficients = {
    .stages = 6,
    .gamma = 0.25,
    .a = a,
    .c = c,
    .time = time,
    .slope = slope,
    .dense = {d2, d3},
};

const bd_method bd_method_rodas4 = {
    .name = "rodas4",
    .implicit = 1,
    .order = 4,
    .error_order = 4,
    .vectors = 8,
    .adaptive = 1,
    .growth = 5.0,
    .error_target = {10.0, 1.0},
    .error_target_smooth = {70.0, 1.0},
    .cost = {3.00, 0.150},
    BD_ROSENBROCK(&coefficients),
};
