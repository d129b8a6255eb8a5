/* SPDX-License-Identifier: MIT
 *
 * The tension of the free spans, from the forces of the joints and from what touches the pulleys.
 */
#include <math.h>

#include "beltdyn.h"

/* Link i, counted past the ends of the ring. */
static int on_ring(int i, int n) {
  return i < 0 ? i + n : i >= n ? i - n : i;
}

void bd_span_tension(int n, const int32_t *touched, const double *force, int np, double *tension) {
  int first = -1; /* any link on a pulley */
  for (int i = 0; first < 0 && i < n; ++i) {
    first = touched[i] >= 0 ? i : -1;
  }
  for (int j = 0; j < np; ++j) {
    tension[j] = (double)NAN;
  }
  /* more than one stretch of free links may follow a pulley: hence the whole ring for each */
  for (int j = 0; first >= 0 && j < np; ++j) {
    double sum = 0.0, before = 0.0; /* before: in front of single free links */
    int joints = 0, singles = 0;
    for (int done = 0; done < n;) {
      const int at = on_ring(first + done, n), from = touched[at];
      int free = 0; /* links until the next that touches a pulley */
      while (done + free + 1 < n && touched[on_ring(at + free + 1, n)] < 0) {
        ++free;
      }
      const int to = touched[on_ring(at + free + 1, n)];
      const int spans = from == j && (from != to || np == 1);
      if (spans && free == 1) {
        before += force[on_ring(at + 1, n)];
        ++singles;
      }
      for (int q = 2; spans && q <= free; ++q) {
        sum += force[on_ring(at + q, n)];
        ++joints;
      }
      done += free + 1;
    }
    tension[j] = joints > 0 ? sum / joints : singles > 0 ? before / singles : (double)NAN;
  }
}
