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

/* One of the ring's matrices without contact, of links that contact couples as well. */
static void fill_ring_links(const bd_layout *lay, const bd_matrix *out) {
  const bd_tangent *t = out->joints;
  const vec straight = splat(out->mass + 2.0 * out->k), arm = splat(out->arm), none = splat(0.0);
  const vec bent = splat(out->inertia + 2.0 * (out->k + out->bend));
  for (int i = 0; i < lay->n8; i += WIDTH) {
    joint_link link[3];
    vec unused[9], entries[3][9];
    for (int k = 0; k < 3; ++k) {
      const int at = i - 1 + k;
      link[k] = joint_link_of(out, load_unaligned(t->cos + at), load_unaligned(t->sin + at),
                              load_unaligned(t->spin + at));
    }
    const vec turning = fma_(splat(out->pull), load(t->pull + i), bent);
    const vec own[9] = {straight, none, none, none, straight, none, none, none, turning};
    couple(out, &link[BACK], &link[DIAGONAL], entries[BACK], unused);
    couple(out, &link[DIAGONAL], &link[AHEAD], unused, entries[AHEAD]);
    memcpy(entries[DIAGONAL], own, sizeof own);
    for (int place = 0; place < 3; ++place) {
      for (int e = 0; e < 9; ++e) {
        const vec entry = entries[place][e];
        store(entry_of(out->tiles, 3, i, place, e), e % 3 == 2 ? arm * entry : entry);
      }
    }
  }
}

/* Joints are seen where the matrix is used (couple); contact that Q knows stands with the slots. */
static void fill_ring_centres(const bd_layout *lay, const bd_matrix *out) {
  if (out->tiles) {
    memset(out->tiles, 0, (size_t)(4 * lay->stride - BD_HALO) * sizeof *out->tiles);
  }
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
