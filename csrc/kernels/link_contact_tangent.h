/* SPDX-License-Identifier: MIT
 *
 * Contact along the links, or along the bars of a string, in the linear systems: into the blocks W
 * and Q, the rows and columns of bodies, and what solves need of the states of friction. Compiled
 * once per instruction level, in jacobian.h; names as in link_geometry.h.
 *
 * A segment is a link, with its three unknowns for columns, or a bar, with those of its two masses.
 * An end of a link moves by dr = d(x, y) -+ e' p and dv = d(v_x, v_y) -+ e' p_v +- w e p, upper
 * signs at the left end, p = l0/2 dphi; there dp = -n.dr, dp' = -n.dv - (v_t / rho) t.dr. Friction
 * acts at points: the joints, which are the mean of two ends and give each half of their force, or
 * the masses themselves. A point sees the six unknowns of the two segments that meet there. A force
 * at a link's end acts on it by (1, -+e')^T, which turns with it.
 *
 * First the segments: normal forces, kept as rows by their columns. Then the points: friction, its
 * states eliminated. Last what points are worth to links. All entries are Q's, g^2 F_q; and W's,
 * -(g F_v + g^2 F_q).
 */
#include "kernels/link_geometry.h"

/* The normal forces of links and what p and p' of their ends, 0 left and 1 right, do to them; and
 * the place where p = 0, and its rate, by p_a and p_b. */
typedef struct normal_linear {
  vec force[2], by[8], cut_by[2], cut_rate_by[2];
  contact_part part;
} normal_linear;

INLINE normal_linear normals_of(const bd_contact_pulley *pulley, const link_end *ends,
                                const int hunt_crossley) {
  const link_end *a = &ends[0], *b = &ends[1];
  const vec none = splat(0.0), one = splat(1.0), half = splat(0.5), two = splat(2.0);
  const vec quadratic = splat(pulley->quadratic), linear = splat(pulley->linear);
  const contact_damping damping = contact_damping_of(pulley);
  normal_linear n = {.part = part_of(a, b)};
  const contact_part part = n.part;
  const mask cut = less(none, part.moves * part.moves);
  const vec share = part.x1 - part.x0, middle = half * (part.x0 + part.x1);
  const vec weight = half * share, inv = where(cut, part.inv_difference);
  const vec twice = two * part.cut_rate;
  n.cut_by[0] = -(b->p * inv * inv);
  n.cut_by[1] = a->p * inv * inv;
  n.cut_rate_by[0] = fnma_(twice, inv, b->rate * inv * inv);
  n.cut_rate_by[1] = fma_(twice, inv, -(a->rate * inv * inv));
  vec cut_by_left = none, cut_by_right = none;
  for (int m = 0; m < 8; ++m) {
    n.by[m] = none;
  }
  n.force[0] = n.force[1] = none;
  for (int g = -1; g <= 1; g += 2) {
    const vec x = fma_(splat(g * GAUSS), share, middle), back = one - x;
    const vec p = fma_(back, a->p, x * b->p), rate = fma_(back, a->rate, x * b->rate);
    const vec elastic = fma_(quadratic, p, linear) * p;
    const vec damped = damping_at(&damping, elastic, hunt_crossley);
    const vec raw = fma_(damped, rate, elastic);
    const mask on = less(none, raw);
    const vec q = where(on, raw);
    const vec steep = stiffness_at(&damping, fma_(two * quadratic, p, linear), rate, hunt_crossley);
    const vec stiff = where(on, weight * steep);
    const vec damp = where(on, weight * damped);
    n.force[0] = fma_(weight * q, back, n.force[0]);
    n.force[1] = fma_(weight * q, x, n.force[1]);
    const vec aa = back * back, ab = back * x, bb = x * x;
    n.by[0] = fma_(aa, stiff, n.by[0]);
    n.by[1] = fma_(ab, stiff, n.by[1]);
    n.by[2] = fma_(aa, damp, n.by[2]);
    n.by[3] = fma_(ab, damp, n.by[3]);
    n.by[5] = fma_(bb, stiff, n.by[5]);
    n.by[7] = fma_(bb, damp, n.by[7]);
    /* the Gauss point's place by that of p = 0, and the weight by it */
    const vec along = fma_(part.moves, splat(g * GAUSS), half);
    const vec slope = along * fma_(stiff, b->p - a->p, damp * (b->rate - a->rate));
    const vec heavier = half * part.moves * q, moved = along * weight * q;
    cut_by_left += fma_(heavier + slope, back, -moved);
    cut_by_right += fma_(heavier + slope, x, moved);
  }
  n.by[4] = n.by[1];
  n.by[6] = n.by[3];
  for (int e = 0; e < 2; ++e) {
    n.by[e] = fma_(cut_by_left, n.cut_by[e], n.by[e]);
    n.by[4 + e] = fma_(cut_by_right, n.cut_by[e], n.by[4 + e]);
  }
  return n;
}

/* What a step of length h does to N beyond its tangent, into `correction`: a straight step leaves
 * the rim by (h v_t)^2 / (2 rho), and where it brings an end into contact, forces and derivatives
 * are those of the penetrations then. */
INLINE void correct(const bd_contact_pulley *pulley, const link_end *ends, double h,
                    normal_linear *n, vec *correction, const int hunt_crossley) {
  const vec none = splat(0.0), step = splat(h), bend = splat(0.5 * h * h);
  link_end later[2] = {ends[0], ends[1]};
  vec leave[2];
  mask lands = less(none, none);
  for (int e = 0; e < 2; ++e) {
    leave[e] = bend * ends[e].around * ends[e].around * ends[e].inv_rho;
    later[e].p = fma_(step, ends[e].rate, ends[e].p - leave[e]);
    lands |= except(less(none, later[e].p), less(none, ends[e].p));
  }
  for (int e = 0; e < 2; ++e) {
    correction[e] = -fma_(n->by[4 * e], leave[0], n->by[4 * e + 1] * leave[1]);
  }
  if (!any(lands)) {
    return;
  }
  const normal_linear then = normals_of(pulley, later, hunt_crossley);
  for (int e = 0; e < 2; ++e) {
    const vec along = step * fma_(then.by[4 * e], ends[0].rate, then.by[4 * e + 1] * ends[1].rate);
    correction[e] = choose(lands, then.force[e] - n->force[e] - along, correction[e]);
  }
  for (int m = 0; m < 8; ++m) {
    n->by[m] = choose(lands, then.by[m], n->by[m]);
  }
}

/* --- segments -------------------------------------------------------------------------------- */

/* Columns of a segment. */
INLINE int columns_of(const int belt) {
  return belt == STRING ? 4 : 3;
}

/* By the columns of a segment: p of its ends, p' by positions (by velocities it is p by positions),
 * and the move along the pulley. Of a bar only the two columns of its end's own mass are set. */
typedef struct segment_rows {
  vec press[2][4], rate[2][4], along[2][4];
} segment_rows;

INLINE segment_rows rows_of(const bd_tangent *tangent, const vec *nx, const vec *ny,
                            const vec *around, int i, const int belt) {
  segment_rows r;
  for (int e = 0; e < 2; ++e) {
    const int k = belt == STRING ? 2 * e : 0;
    r.press[e][k] = -nx[e];
    r.press[e][k + 1] = -ny[e];
    r.along[e][k] = -ny[e];
    r.along[e][k + 1] = nx[e];
    r.rate[e][k] = around[e] * ny[e];
    r.rate[e][k + 1] = -(around[e] * nx[e]);
    if (belt != STRING) {
      const vec c = load(tangent->cos + i), s = load(tangent->sin + i);
      const vec w = load(tangent->spin + i), wc = w * c, ws = w * s;
      const vec x = e == 0 ? s : -s, y = e == 0 ? -c : c; /* the end's move by p, its rate */
      const vec vx = e == 0 ? wc : -wc, vy = e == 0 ? ws : -ws;
      r.press[e][2] = -fma_(nx[e], x, ny[e] * y);
      r.along[e][2] = fnma_(ny[e], x, nx[e] * y);
      r.rate[e][2] = -fma_(around[e], r.along[e][2], fma_(nx[e], vx, ny[e] * vy));
    }
  }
  return r;
}

/* What depends on p_a, p_b, p_a', p_b' by l, by a segment's columns: positions, velocities. */
INLINE void row_of(const vec *l, const segment_rows *r, vec *q, vec *v, const int belt) {
  for (int k = 0; k < columns_of(belt); ++k) {
    if (belt == STRING) {
      const int e = k / 2;
      v[k] = l[2 + e] * r->press[e][k];
      q[k] = fma_(l[e], r->press[e][k], l[2 + e] * r->rate[e][k]);
    } else {
      v[k] = fma_(l[2], r->press[0][k], l[3] * r->press[1][k]);
      q[k] = fma_(l[0], r->press[0][k],
                  fma_(l[1], r->press[1][k], fma_(l[2], r->rate[0][k], l[3] * r->rate[1][k])));
    }
  }
}

/* Adds to a rate what a force does to nodes. */
INLINE void accelerate(const bd_links *links, double *c, int i, link_force f, const int belt) {
  double *v = bd_field(&links->lay, c, F_VX);
  add_to(v, i, splat(links->inv_mass) * f.x);
  add_to(v + links->lay.stride, i, splat(links->inv_mass) * f.y);
  if (belt != STRING) {
    add_to(v + 2 * links->lay.stride, i, splat(links->half * links->inv_inertia) * f.p);
  }
}

/* What is filled and from where: the same for all vectors of a pulley. */
typedef struct filling {
  const bd_links *links;
  const bd_tangent *tangent;
  const bd_contact_pulley *pulley;
  const bd_fill *of;
  const bd_contact_scratch *scratch;
  const bd_assembled *blocks;
  const bd_body *body;
  const bd_axis *axis; /* NULL: it does not move */
  vec g, g2, arm;
} filling;

typedef struct vec_sums {
  vec own, torque, x, y;
} vec_sums;

/* A mount's column, and the one of its given travel, of forces that a move of the nodes along an
 * axis k makes: q by positions, v by velocities. */
INLINE void against_axis(const bd_axis *axis, const int k, vec q, vec v, vec *column, vec *given) {
  const vec a = splat(axis->a[k]), b = splat(axis->bend[k]);
  const vec turned = fma_(b, v, a * q);
  *column += fma_(a, v, turned);
  *given -= turned;
}

/* Normal forces of links into their diagonal blocks. */
INLINE void fill_normals(const filling *f, const segment_rows *r, vec (*q)[4], vec (*v)[4],
                         const vec *nx, const vec *ny, const vec *n, const vec *over, int i) {
  const vec c = load(f->tangent->cos + i), s = load(f->tangent->sin + i), none = splat(0.0);
  const vec pull = fma_(c, n[1] * nx[1] - n[0] * nx[0], s * (n[1] * ny[1] - n[0] * ny[0]));
  const vec turning = f->g2 / f->arm * pull;
  const int stride = f->links->lay.stride;
  vec column[3] = {none, none, none}, given[3] = {none, none, none};
  for (int k = 0; k < 3; ++k) {
    vec qx[2], qy[2], vx[2], vy[2];
    for (int e = 0; e < 2; ++e) {
      const vec along = over[e] * r->along[e][k];
      qx[e] = fnma_(along, ny[e], q[e][k] * nx[e]);
      qy[e] = fma_(along, nx[e], q[e][k] * ny[e]);
      vx[e] = v[e][k] * nx[e];
      vy[e] = v[e][k] * ny[e];
    }
    const link_force fq = force_of_ends(c, s, qx[0], qy[0], qx[1], qy[1]);
    const link_force fv = force_of_ends(c, s, vx[0], vy[0], vx[1], vy[1]);
    vec dq[3] = {f->g2 * fq.x, f->g2 * fq.y, f->g2 * fq.p};
    const vec dv[3] = {f->g * fv.x, f->g * fv.y, f->g * fv.p};
    dq[2] = k == 2 ? dq[2] - turning : dq[2];
    for (int u = 0; u < 3; ++u) {
      double *const at = entry_of(f->blocks->q.tiles, 3, i, 1, 3 * u + k);
      store(at, k == 2 ? fma_(f->arm, dq[u], load(at)) : load(at) + dq[u]);
      add_to(entry_of(f->blocks->w.tiles, 3, i, 1, 3 * u + k), 0, -(dq[u] + dv[u]));
    }
    if (f->axis) {
      const vec ax = splat(f->axis->a[0]), ay = splat(f->axis->a[1]);
      const vec by_q = fma_(ax, dq[0], ay * dq[1]), by_v = fma_(ax, dv[0], ay * dv[1]);
      store(f->axis->body->q + k * stride + i, k == 2 ? -(f->arm * by_q) : -by_q);
      store(f->axis->body->w + k * stride + i, by_q + by_v);
      for (int u = 0; k < 2 && u < 3; ++u) {
        against_axis(f->axis, k, dq[u], dv[u], &column[u], &given[u]);
      }
    }
  }
  for (int u = 0; f->axis && u < 3; ++u) {
    store(f->axis->body->column + u * stride + i, column[u]);
    store(f->axis->body->given + u * stride + i, given[u]);
  }
}

/* Nothing is in contact, nor will be. */
INLINE void clear_segments(const filling *f, int i, const int belt) {
  const bd_contact_scratch *scratch = f->scratch;
  const bd_pressure p = scratch->pressure;
  double *const arrays[] = {
      p.left,      p.right,      p.share_left,           p.share_right,
      p.rate_left, p.rate_right, scratch->correction[0], scratch->correction[1]};
  for (size_t k = 0; k < sizeof arrays / sizeof arrays[0]; ++k) {
    store(arrays[k] + i, splat(0.0));
  }
  for (int k = 0; k < 4 * columns_of(belt); ++k) {
    store(scratch->end[0][k] + i, splat(0.0));
    store(scratch->end[1][k] + i, splat(0.0));
  }
  for (int k = i; f->axis && belt != STRING && k < i + 3 * f->links->lay.stride;
       k += f->links->lay.stride) {
    store(f->axis->body->q + k, splat(0.0));
    store(f->axis->body->w + k, splat(0.0));
    store(f->axis->body->column + k, splat(0.0));
    store(f->axis->body->given + k, splat(0.0));
  }
}

/* Segments: normal forces, shares, and their rows. */
INLINE void fill_segment_forces(const filling *f, int i, vec_sums *sums, const int belt,
                                const int hunt_crossley) {
  const bd_contact_scratch *scratch = f->scratch;
  const bd_pressure to = scratch->pressure;
  const vec radius = splat(f->pulley->radius), none = splat(0.0), one = splat(1.0);
  const vec step = splat(f->of->c ? f->of->h : 0.0);
  const int columns = columns_of(belt);
  const mask link = less(none, load(f->links->link_mask + i));
  const link_place at =
      place_of(f->links, f->pulley, f->of->y, f->tangent->cos, f->tangent->sin, i, belt == STRING);
  const link_end ends[2] = {end_at(&at, 0, radius), end_at(&at, 1, radius)};
  const vec soon[2] = {fma_(step, ends[0].rate, ends[0].p), fma_(step, ends[1].rate, ends[1].p)};
  if (!any(less(none, larger(larger(ends[0].p, ends[1].p), larger(soon[0], soon[1]))))) {
    clear_segments(f, i, belt);
    return;
  }
  normal_linear n = normals_of(f->pulley, ends, hunt_crossley);
  vec nx[2], ny[2], around[2], normal[2], over[2], q[2][4], v[2][4];
  if (f->of->c) {
    vec more[2];
    correct(f->pulley, ends, f->of->h, &n, more, hunt_crossley);
    for (int e = 0; e < 2; ++e) {
      more[e] = where(link, more[e]);
      store(scratch->correction[e] + i, more[e]);
    }
    if (belt != STRING) {
      const link_force by =
          force_of_ends(load(f->tangent->cos + i), load(f->tangent->sin + i), more[0] * ends[0].nx,
                        more[0] * ends[0].ny, more[1] * ends[1].nx, more[1] * ends[1].ny);
      accelerate(f->links, f->of->c, i, by, belt);
      sums->x += by.x;
      sums->y += by.y;
    }
  }
  const contact_part part = n.part;
  const vec right = splat(0.5) * fnma_(part.x0, part.x0, part.x1 * part.x1);
  const vec turning = part.moves * part.cut_rate, kept = one - part.cut;
  for (int e = 0; e < 2; ++e) {
    nx[e] = where(link, ends[e].nx);
    ny[e] = where(link, ends[e].ny);
    around[e] = where(link, ends[e].around * ends[e].inv_rho);
    normal[e] = where(link, n.force[e]);
    over[e] = where(link, n.force[e] * ends[e].inv_rho);
  }
  store(to.left + i, normal[0]);
  store(to.right + i, normal[1]);
  store(to.share_left + i, part.x1 - part.x0 - right);
  store(to.share_right + i, right);
  store(to.rate_left + i, turning * kept);
  store(to.rate_right + i, turning * part.cut);
  const segment_rows r = rows_of(f->tangent, nx, ny, around, i, belt);
  const int moves = any(less(none, part.moves * part.moves));
  for (int e = 0; e < 2; ++e) {
    double *const *const row = scratch->end[e];
    const vec by[4] = {where(link, n.by[4 * e]), where(link, n.by[4 * e + 1]),
                       where(link, n.by[4 * e + 2]), where(link, n.by[4 * e + 3])};
    row_of(by, &r, q[e], v[e], belt);
    vec share[4] = {none, none, none, none}, rate[4] = {none, none, none, none};
    if (moves) {
      const vec side = part.moves * (e == 0 ? kept : part.cut);
      const vec change = part.moves * (e == 0 ? -part.cut_rate : part.cut_rate);
      vec l[4];
      for (int m = 0; m < 2; ++m) {
        l[2 + m] = side * n.cut_by[m];
        l[m] = fma_(change, n.cut_by[m], side * n.cut_rate_by[m]);
      }
      row_of(l, &r, rate, share, belt);
    }
    for (int k = 0; k < columns; ++k) {
      store(row[k] + i, q[e][k]);
      store(row[columns + k] + i, v[e][k]);
      store(row[2 * columns + k] + i, share[k]);
      store(row[3 * columns + k] + i, rate[k]);
    }
  }
  if (belt != STRING) {
    fill_normals(f, &r, q, v, nx, ny, normal, over, i);
  }
}
