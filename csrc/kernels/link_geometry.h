/* SPDX-License-Identifier: MIT
 *
 * What contact along the links (MODEL section 3, mesh "joint") is made of, for the rate
 * (link_contact.h) and its derivatives (link_contact_tangent.h).
 *
 * Penetration runs linearly between the two ends of a link, p(x) = (1 - x) p_a + x p_b, and the
 * contact is the part of it where p > 0. With q = max(0, c1 p^2 + c2 p + b p'), by two Gauss points
 * on that part, N_a = int q (1 - x) dx acts at the link's left end and N_b = int q x dx at its
 * right end. Friction acts at the joints, the mean of the two ends that meet there, under the
 * normal force of both. Its state is the mean over the belt in contact, the share f of the joint's
 * two half links (weights 1 - x and x); belt that comes into contact brings unstrained bristles:
 *
 *   z' = law(z, v_T, N / f) - z max(0, f') / (f + FRESH),   F = f law's force at N / f
 */

#ifndef BELTDYN_LINK_GEOMETRY_H
#define BELTDYN_LINK_GEOMETRY_H

/* Keeps the rate finite where a joint comes into contact, f = 0; friction is of order f^2 there. */
#define FRESH 0.01
/* Of a Gauss point, from the middle of its interval, over the interval's length. */
#define GAUSS 0.28867513459481288225

/* One end of a vector of links, as seen from a pulley. */
typedef struct link_end {
  vec nx, ny, inv_rho, p, rate, around; /* outward normal; penetration, its rate; v along t */
} link_end;

INLINE link_end end_of(vec x, vec y, vec vx, vec vy, vec radius) {
  vec rho;
  link_end end;
  root_and_inverse(fma_(x, x, y * y), &rho, &end.inv_rho);
  end.nx = x * end.inv_rho;
  end.ny = y * end.inv_rho;
  end.p = radius - rho;
  end.rate = -fma_(vx, end.nx, vy * end.ny);
  end.around = fnma_(vx, end.ny, vy * end.nx);
  return end;
}

/* The part [x0, x1] of a vector of links that is in contact; `moves` is +1 where x1 is where p = 0,
 * -1 where x0 is, else 0; that place, and its rate. */
typedef struct contact_part {
  vec x0, x1, cut, cut_rate, moves, inv_difference;
} contact_part;

INLINE contact_part part_of(const link_end *a, const link_end *b) {
  const vec none = splat(0.0), one = splat(1.0);
  const mask in_a = less(none, a->p), in_b = less(none, b->p);
  const mask leaves = except(in_a, in_b), enters = except(in_b, in_a);
  if (!any(leaves | enters)) { /* on all of their length, or nowhere */
    return (contact_part){.x0 = none,
                          .x1 = where(in_b, one),
                          .cut = none,
                          .cut_rate = none,
                          .moves = none,
                          .inv_difference = one};
  }
  const vec inv = one / choose(leaves | enters, a->p - b->p, one);
  const vec cut = where(leaves | enters, a->p * inv);
  const vec turning = fnma_(b->p, a->rate, a->p * b->rate) * inv * inv;
  return (contact_part){.x0 = where(enters, cut),
                        .x1 = choose(leaves, cut, where(in_b, one)),
                        .cut = cut,
                        .cut_rate = where(leaves | enters, turning),
                        .moves = choose(leaves, one, where(enters, -one)),
                        .inv_difference = inv};
}

/* The two ends of a vector of links relative to a pulley's axis: 0 left, 1 right. */
typedef struct link_place {
  vec x[2], y[2], vx[2], vy[2];
} link_place;

/* What stands in v with the links behind those from i on: behind the last one comes the first; the
 * padding sees itself. */
INLINE vec of_next(const double *v, int i, int n) {
  const vec next = load_unaligned(v + i + 1);
  if (i + WIDTH < n) {
    return next;
  }
  const vec lane = lane_numbers();
  const mask inner = less(lane, splat(n - 1 - i)), link = less(lane, splat(n - i));
  return choose(inner, next, choose(link, splat(v[0]), load(v + i)));
}

/* Of a string: from each mass to the one behind it. */
INLINE link_place bar_of(const bd_links *links, const bd_contact_pulley *pulley, const double *y,
                         int i) {
  const bd_layout *lay = &links->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const vec cx = splat(pulley->x), cy = splat(pulley->y);
  const vec cu = splat(pulley->vx), cv = splat(pulley->vy);
  return (link_place){{load(x + i) - cx, of_next(x, i, lay->n) - cx},
                      {load(yy + i) - cy, of_next(yy, i, lay->n) - cy},
                      {load(vx + i) - cu, of_next(vx, i, lay->n) - cu},
                      {load(vy + i) - cv, of_next(vy, i, lay->n) - cv}};
}

INLINE link_place place_of(const bd_links *links, const bd_contact_pulley *pulley, const double *y,
                           const double *co, const double *si, int i, const int string) {
  const bd_layout *lay = &links->lay;
  if (string) {
    return bar_of(links, pulley, y, i);
  }
  const vec half = splat(links->half), w = load(bd_cfield(lay, y, F_VPHI) + i);
  const vec x = load(bd_cfield(lay, y, F_X) + i) - splat(pulley->x);
  const vec yy = load(bd_cfield(lay, y, F_Y) + i) - splat(pulley->y);
  const vec vx = load(bd_cfield(lay, y, F_VX) + i) - splat(pulley->vx);
  const vec vy = load(bd_cfield(lay, y, F_VY) + i) - splat(pulley->vy);
  const vec ex = half * load(co + i), ey = half * load(si + i);
  const vec spin_x = -(w * ey), spin_y = w * ex;
  return (link_place){
      {x - ex, x + ex}, {yy - ey, yy + ey}, {vx - spin_x, vx + spin_x}, {vy - spin_y, vy + spin_y}};
}

INLINE link_end end_at(const link_place *at, const int end, vec radius) {
  return end_of(at->x[end], at->y[end], at->vx[end], at->vy[end], radius);
}

/* Of the nearer end of a link, squared. */
INLINE vec nearer_end(const link_place *at) {
  const vec a = fma_(at->x[0], at->x[0], at->y[0] * at->y[0]);
  const vec b = fma_(at->x[1], at->x[1], at->y[1] * at->y[1]);
  return choose(less(a, b), a, b);
}

/* In front of every run stands a link that is far from the pulley; but the run that begins with
 * link 0 goes on from the last one, if that is listed. */
INLINE void close_runs(double *const *arrays, size_t n_arrays, int n_runs, const bd_run *runs,
                       int n, double elsewhere) {
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, round = begin == 0 && runs[n_runs - 1].end >= n;
    for (size_t k = 0; k < n_arrays; ++k) {
      arrays[k][begin - 1] = round ? arrays[k][n - 1] : elsewhere;
    }
  }
}

typedef struct joint_points {
  const double *x, *y, *vx, *vy;
} joint_points;

/* Where friction acts: at the joints; of a string at its masses. */
INLINE joint_points points_of(const bd_layout *lay, const bd_points *joints, const double *y,
                              const int string) {
  return string ? (joint_points){bd_cfield(lay, y, F_X), bd_cfield(lay, y, F_Y),
                                 bd_cfield(lay, y, F_VX), bd_cfield(lay, y, F_VY)}
                : (joint_points){joints->x, joints->y, joints->vx, joints->vy};
}

/* What a joint has of the contact of its two links. */
typedef struct joint_contact {
  vec normal, share, inv_share, fresh; /* fresh: rate at which belt comes into contact, over it */
  mask touch;
} joint_contact;

INLINE joint_contact joint_contact_of(const bd_links *links, const bd_pressure *from, int i) {
  const vec none = splat(0.0), one = splat(1.0);
  const vec share = load(from->share_left + i) + load_unaligned(from->share_right + i - 1);
  const vec rate = load(from->rate_left + i) + load_unaligned(from->rate_right + i - 1);
  const mask touch = less(none, share) & less(none, load(links->link_mask + i));
  return (joint_contact){
      .normal = where(touch, load(from->left + i) + load_unaligned(from->right + i - 1)),
      .share = share,
      .inv_share = where(touch, one / choose(touch, share, one)),
      .fresh = where(touch, larger(rate, none) / (share + splat(FRESH))),
      .touch = touch};
}

/* Forces at a link's left and right end, those of its joints included. */
typedef struct both_ends {
  vec lx, ly, rx, ry;
} both_ends;

INLINE both_ends forces_on(const bd_end_forces *at, int i) {
  const vec half = splat(0.5);
  return (both_ends){fma_(half, load(at->joint_x + i), load(at->left_x + i)),
                     fma_(half, load(at->joint_y + i), load(at->left_y + i)),
                     fma_(half, load_unaligned(at->joint_x + i + 1), load(at->right_x + i)),
                     fma_(half, load_unaligned(at->joint_y + i + 1), load(at->right_y + i))};
}

#endif
