/* SPDX-License-Identifier: MIT
 *
 * The linearised model, compiled once per instruction level: what newton_system.c needs of every
 * link, in loops over the blocks of the state's layout. newton_system.c has the derivation and the
 * names.
 */

#include "kernels/blocks.h"

/* --- joints ---------------------------------------------------------------------------------- */

/* Keeps of the last evaluation, at y, what the joints' linearisation needs: later evaluations, at
 * other states, write over the links' directions. */
static void linearise_links(const bd_links *links, const double *y, const bd_tangent *tangent) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, n8 = lay->n8;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *vphi = bd_cfield(lay, y, F_VPHI), *co = links->cos, *si = links->sin;
  double *lx = links->fx, *ly = links->fy, *rx = links->rx, *ry = links->ry;
  const bd_tangent t = *tangent;
  const vec half = splat(links->half), inv_half = splat(1.0 / links->half);
  const vec stiffness = splat(links->stiffness), damping = splat(links->damping);
  /* what each end of a link adds to the force of its joint */
  for (int i = 0; i < n8; i += WIDTH) {
    const vec c = load(co + i), s = load(si + i), w = load(vphi + i);
    const vec hc = half * c, hs = half * s, turning = damping * w;
    const vec ex = fnma_(turning, hs, stiffness * hc), ey = fma_(turning, hc, stiffness * hs);
    const vec sx = fma_(stiffness, load(x + i), damping * load(vx + i));
    const vec sy = fma_(stiffness, load(yy + i), damping * load(vy + i));
    store(lx + i, sx - ex);
    store(ly + i, sy - ey);
    store(rx + i, sx + ex);
    store(ry + i, sy + ey);
    store(t.cos + i, c);
    store(t.sin + i, s);
    store(t.spin + i, w);
  }
  rx[-1] = rx[n - 1];
  ry[-1] = ry[n - 1];
  lx[n] = lx[0];
  ly[n] = ly[0];
  for (int i = 0; i < n8; i += WIDTH) {
    const vec fx =
        (load(lx + i) - load_unaligned(rx + i - 1)) + (load_unaligned(lx + i + 1) - load(rx + i));
    const vec fy =
        (load(ly + i) - load_unaligned(ry + i - 1)) + (load_unaligned(ly + i + 1) - load(ry + i));
    store(t.pull + i, inv_half * fma_(load(co + i), fx, load(si + i) * fy));
  }
  t.cos[-1] = t.cos[n - 1];
  t.sin[-1] = t.sin[n - 1];
  t.spin[-1] = t.spin[n - 1];
}

/* The ring's blocks without contact; entries that are 0 stay so where joints alone couple links. */
INLINE void fill_ring(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                      const bd_assembled *out, const int joints) {
  const bd_layout *lay = &links->lay;
  const double g2_ = stage->g * stage->g, half = links->half;
  const vec g2 = splat(g2_), none = splat(0.0), spin = splat(g2_ * links->damping);
  tangent->cos[lay->n] = tangent->cos[0];
  tangent->sin[lay->n] = tangent->sin[0];
  tangent->spin[lay->n] = tangent->spin[0];
  for (int m = 0; m < 2; ++m) { /* Q, then W, which has the other sign */
    const vec k = splat(m ? stage->k : g2_ * links->stiffness), two = k + k;
    const vec bend = splat(m ? stage->bending : g2_ * links->bending / (half * half));
    const vec straight = m ? two + splat(stage->mass) : two;
    const vec bent = bend + bend + two + splat(m ? stage->mass / stage->slender : 0.0);
    const vec sign = splat(m ? 1.0 : -1.0), turned = splat(m ? 1.0 : -half);
    double *const to = m ? out->w : out->q;
    for (int i = 0; i < lay->n8; i += WIDTH) {
      const vec c = load(tangent->cos + i), s = load(tangent->sin + i);
      const vec cl = load_unaligned(tangent->cos + i - 1);
      const vec sl = load_unaligned(tangent->sin + i - 1);
      const vec ca = load_unaligned(tangent->cos + i + 1);
      const vec sa = load_unaligned(tangent->sin + i + 1);
      const vec w = spin * load_unaligned(tangent->spin + i + 1);
      const vec wl = spin * load_unaligned(tangent->spin + i - 1);
      const vec qx = fma_(k, sa, w * ca), qy = fnma_(k, ca, w * sa);
      const vec qxl = fma_(k, sl, wl * cl), qyl = fnma_(k, cl, wl * sl);
      const vec entries[3][9] = {
          {-k, none, qxl, none, -k, qyl, -(k * s), k * c, fma_(s, qxl, -fma_(c, qyl, bend))},
          {straight, none, none, none, straight, none, none, none,
           fma_(g2, load(tangent->pull + i), bent)},
          {-k, none, -qx, none, -k, -qy, k * s, -(k * c), fma_(s, qx, -fma_(c, qy, bend))}};
      for (int place = 0; place < 3; ++place) {
        for (int e = 0; e < 9; ++e) {
          if (is_stored(place, e, joints)) {
            store(entry_of(to, 3, i, place, e), (e % 3 == 2 ? turned : sign) * entries[place][e]);
          }
        }
      }
    }
  }
}

static void fill_ring_links(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                            const bd_assembled *out) {
  fill_ring(links, tangent, stage, out, 0);
}

static void fill_ring_centres(const bd_links *links, const bd_tangent *tangent,
                              const bd_stage *stage, const bd_assembled *out) {
  fill_ring(links, tangent, stage, out, 1);
}

#include "kernels/link_contact_tangent.h"

#include "kernels/centre_contact.h"
#include "kernels/contact_points.h"
#include "kernels/string_jacobian.h"

RING(links, 3, 0)
RING(centres, 3, 1)
RING(string, 2, 0)

#define NEWTON(name, belt, d, nodes)                                                               \
  const bd_newton_kernels PASTE(name, BD_LEVEL) = {                                                \
      RING_MEMORY(d),                                                                              \
      .factor = factor_##belt,                                                                     \
      .solve = solve_##belt,                                                                       \
      .linearise_joints = linearise_##nodes,                                                       \
      .finish_nodes = finish_nodes_##nodes,                                                        \
      .fill_ring = fill_ring_##belt,                                                               \
      .fill_pulley = {fill_pulley_NONE_##belt, BD_LAWS(LAW_##belt)},                               \
      .blocks_product = blocks_product_##belt,                                                     \
      .states_product = states_product_##belt,                                                     \
      .row_runs = row_runs_##belt,                                                                 \
      .add_column = add_column_##nodes,                                                            \
      .restore_states = restore_states_##belt,                                                     \
      .sum_runs = sum_runs,                                                                        \
  };
#define LAW_links(name, class, general, states, text) [BD_LAW_##name] = fill_pulley_##name##_links,
#define LAW_string(name, class, general, states, text)                                             \
  [BD_LAW_##name] = fill_pulley_##name##_string,
#define LAW_centres(name, class, general, states, text)                                            \
  [BD_LAW_##name] = fill_pulley_##name##_centres,
NEWTON(bd_newton_, links, 3, links)
NEWTON(bd_newton_centres_, centres, 3, links)
NEWTON(bd_newton_string_, string, 2, string)
