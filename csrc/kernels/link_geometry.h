/* SPDX-License-Identifier: MIT
 *
 * What contact along the links (MODEL section 3, mesh "joint") is made of, for the rate
 * (link_contact.h) and its derivatives (link_contact_jacobian.h).
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

/* A vector of links relative to a pulley's axis: centres, and half the link along itself. */
typedef struct link_place {
  vec x, y, vx, vy, ex, ey, spin_x, spin_y;
} link_place;

INLINE link_place place_of(const bd_links *links, const bd_contact_pulley *pulley, const double *y,
                           const double *co, const double *si, int i) {
  const bd_layout *lay = &links->lay;
  const vec half = splat(links->half), w = load(bd_cfield(lay, y, F_VPHI) + i);
  link_place at = {.x = load(bd_cfield(lay, y, F_X) + i) - splat(pulley->x),
                   .y = load(bd_cfield(lay, y, F_Y) + i) - splat(pulley->y),
                   .vx = load(bd_cfield(lay, y, F_VX) + i) - splat(pulley->vx),
                   .vy = load(bd_cfield(lay, y, F_VY) + i) - splat(pulley->vy),
                   .ex = half * load(co + i),
                   .ey = half * load(si + i)};
  at.spin_x = -(w * at.ey);
  at.spin_y = w * at.ex;
  return at;
}

INLINE link_end left_end(const link_place *at, vec radius) {
  return end_of(at->x - at->ex, at->y - at->ey, at->vx - at->spin_x, at->vy - at->spin_y, radius);
}

INLINE link_end right_end(const link_place *at, vec radius) {
  return end_of(at->x + at->ex, at->y + at->ey, at->vx + at->spin_x, at->vy + at->spin_y, radius);
}

/* Of the nearer end of a link, squared. */
INLINE vec nearer_end(const link_place *at) {
  const vec ax = at->x - at->ex, ay = at->y - at->ey, bx = at->x + at->ex, by = at->y + at->ey;
  const vec a = fma_(ax, ax, ay * ay), b = fma_(bx, bx, by * by);
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
