/* SPDX-License-Identifier: MIT
 *
 * "tsit5": Ch. Tsitouras, "Runge-Kutta pairs of order 5(4) satisfying only the first column
 * simplifying assumption", Comput. Math. Appl. 62 (2011) 770-775; its free interpolant of order 4.
 * Real stability limit 3.507; 3.0 to 3.5 for modes up to 80 degrees from it, 0.51 if undamped.
 */
#include "solvers/solvers.h"

static const double c[] = {0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0, 1.0};
static const double a[] = {
    0.161,
    -0.008480655492356989,
    0.335480655492357,
    2.8971530571054935,
    -6.359448489975075,
    4.3622954328695815,
    5.325864828439257,
    -11.748883564062828,
    7.4955393428898365,
    -0.09249506636175525,
    5.86145544294642,
    -12.92096931784711,
    8.159367898576159,
    -0.071584973281401,
    -0.028269050394068383,
    0.09646076681806523,
    0.01,
    0.4798896504144996,
    1.379008574103742,
    -3.290069515436081,
    2.324710524099774,
};
static const double error[] = {
    -0.00178001105222577714, -0.0008164344596567469, 0.007880878010261995, -0.1447110071732629,
    0.5823571654525552,      -0.45808210592918697,   1.0 / 66.0,
};

static void dense(double s, double *b) {
  static const double r[7][3] = {
      {-2.763706197274826, 2.9132554618219126, -1.0530884977290216},
      {0.1317, -0.2234, 0.1017},
      {3.9302962368947516, -5.941033872131505, 2.490627285651253},
      {-12.411077166933676, 30.33818863028232, -16.548102889244902},
      {37.50931341651104, -88.1789048947664, 47.37952196281928},
      {-27.896526289197286, 65.09189467479366, -34.87065786149661},
      {1.5, -4.0, 2.5},
  };
  for (int k = 0; k < 7; ++k) {
    b[k] = s * s * (r[k][0] + s * (r[k][1] + s * r[k][2]));
  }
  b[0] += s;
}

static const bd_tableau tableau = {.stages = 7, .c = c, .a = a, .error = error, .dense = dense};

const bd_method bd_method_tsit5 = {
    .name = "tsit5",
    .order = 5,
    .error_order = 5,
    .vectors = 7,
    .adaptive = 1,
    .stability = 3.5,
    .growth = 5.0,
    .error_target = {1.0, 1.0},
    .error_target_smooth = {2.0, 1.0},
    .cost = {0.40, 0.032},
    BD_EXPLICIT(&tableau),
};
