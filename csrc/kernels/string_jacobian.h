/* SPDX-License-Identifier: MIT
 *
 * The string of point masses (string_belt.h) in the linear systems, compiled once per instruction
 * level, in jacobian.h. Two unknowns a mass, in 2 x 2 blocks round the ring.
 *
 * The bar before mass i has the direction u, the normal n, the length l and the pull T; with
 * d = r_i - r_{i-1}, w = v_i - v_{i-1}
 *
 *   d(T u) = u (c u.dd + b u.dw + (b n.w / l) n.dd) + (T / l) n (n.dd)
 */

/* A 2 x 2 block, rows first, from the axes (n, t) of a link to those of the plane. */
typedef struct plane_block {
  vec xx, xy, yx, yy;
} plane_block;

INLINE plane_block turned_back(vec nx, vec ny, vec nn, vec nt, vec tn, vec tt) {
  const vec nx2 = nx * nx, ny2 = ny * ny, nx_ny = nx * ny;
  const vec nn_tt = nx_ny * (nn - tt), both = nx_ny * (nt + tn);
  return (plane_block){.xx = fma_(nx2, nn, fma_(ny2, tt, -both)),
                       .xy = fma_(nx2, nt, fnma_(ny2, tn, nn_tt)),
                       .yx = fma_(nx2, tn, fnma_(ny2, nt, nn_tt)),
                       .yy = fma_(ny2, nn, fma_(nx2, tt, both))};
}

/* As seen from the masses from i on, what stands in v with those before them. */
INLINE vec of_previous(const double *v, int i, int n) {
  const vec previous = load_unaligned(v + i - 1);
  return i > 0 ? previous : choose(less(lane_numbers(), splat(1.0)), splat(v[n - 1]), previous);
}

/* --- bars ------------------------------------------------------------------------------------ */

/* Of a bar: direction into cos and sin, b n.w / l into spin, T / l into pull. */
static void linearise_string(const bd_links *links, const double *y, const bd_tangent *tangent) {
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const vec stiffness = splat(links->stiffness), damping = splat(links->damping);
  const vec l0 = splat(2.0 * links->half);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec dx = load(x + i) - of_previous(x, i, lay->n);
    const vec dy = load(yy + i) - of_previous(yy, i, lay->n);
    const vec du = load(vx + i) - of_previous(vx, i, lay->n);
    const vec dv = load(vy + i) - of_previous(vy, i, lay->n);
    vec length, inv;
    root_and_inverse(fma_(dx, dx, dy * dy), &length, &inv);
    const vec ux = dx * inv, uy = dy * inv;
    const vec rate = fma_(ux, du, uy * dv), across = fnma_(uy, du, ux * dv);
    const mask mass = less(splat(0.0), load(links->link_mask + i));
    store(t.cos + i, where(mass, ux));
    store(t.sin + i, where(mass, uy));
    store(t.spin + i, where(mass, damping * across * inv));
    store(t.pull + i, where(mass, fma_(stiffness, length - l0, damping * rate) * inv));
  }
}

/* The ring's blocks without contact. */
static void fill_ring_string(const bd_links *links, const bd_tangent *tangent,
                             const bd_stage *stage, const bd_assembled *out) {
  const int n = links->lay.n, n8 = links->lay.n8;
  const bd_tangent t = *tangent;
  const double g2_ = stage->g * stage->g;
  const vec g2 = splat(g2_);
  t.cos[n] = t.cos[0];
  t.sin[n] = t.sin[0];
  t.spin[n] = t.spin[0];
  t.pull[n] = t.pull[0];
  for (int m = 0; m < 2; ++m) { /* Q, then W, which has the other sign */
    const vec along = splat(m ? stage->k : g2_ * links->stiffness);
    const vec mass = splat(m ? stage->mass : 0.0), sign = splat(m ? 1.0 : -1.0);
    double *const to = m ? out->w : out->q;
    for (int i = 0; i < n8; i += WIDTH) {
      plane_block bar[2];
      for (int e = 0; e < 2; ++e) { /* the bar before, the one behind */
        bar[e] = turned_back(load_unaligned(t.cos + i + e), load_unaligned(t.sin + i + e), along,
                             g2 * load_unaligned(t.spin + i + e), splat(0.0),
                             g2 * load_unaligned(t.pull + i + e));
      }
      const plane_block p = bar[0], q = bar[1];
      const vec entries[3][4] = {
          {-p.xx, -p.xy, -p.yx, -p.yy},
          {mass + (p.xx + q.xx), p.xy + q.xy, p.yx + q.yx, mass + (p.yy + q.yy)},
          {-q.xx, -q.xy, -q.yx, -q.yy}};
      for (int place = 0; place < 3; ++place) {
        for (int e = 0; e < 4; ++e) {
          store(entry_of(to, 2, i, place, e), sign * entries[place][e]);
        }
      }
    }
  }
}
