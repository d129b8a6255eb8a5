/* SPDX-License-Identifier: MIT
 *
 * The inner loops, compiled once per instruction level (rhs_*.c include this file with their
 * own flags and BD_LEVEL), over structure-of-arrays blocks, a vector of links at a time. Lengths
 * are padded to BD_LANES: the padding is computed like the links and then left out.
 *
 * Joints (2.2, MODEL section 2): d = (r_i - l0/2 e_i) - (r_{i-1} + l0/2 e_{i-1}), force on link i
 * -(c d + b d'), on link i-1 the opposite, each with its moment (2.11)_3 at the link's end.
 * Contact (2.3-2.8) and Dahl friction (2.9-2.10): MODEL sections 3 and 4.
 * Stability: |lambda| of the joints, see model.c. Guarded by tests/test_oracle.py and
 * tests/test_kernels.py (levels against each other).
 */
#include <math.h>

#include "kernels/kernels.h"
#include "kernels/vector.h"

#include "kernels/laws.h"
#include "kernels/normal_force.h"

/* sin and cos together: quadrant by the nearest multiple of pi/2, Cody-Waite reduction with three
 * 33-bit parts (exact for |k| < 2^20), then the polynomials of fdlibm on [-pi/4, pi/4]. Error below
 * 1 ulp of the result's scale. Adding 1.5 * 2^52 rounds, and leaves the multiple in the lowest
 * bits: the first says which of the two is which, the second their signs. */
INLINE void sine_cosine(vec angle, vec *sine, vec *cosine) {
  const vec to_nearest = splat(6755399441055744.0); /* 1.5 * 2^52 */
  const vec shifted = fma_(angle, splat(0.63661977236758134308), to_nearest);
  const vec k = shifted - to_nearest;
  vec r = fma_(k, splat(-1.57079632673412561417e+00), angle);
  r = fma_(k, splat(-6.07710050630396597660e-11), r);
  r = fma_(k, splat(-2.02226624871116645580e-21), r);
  const vec z = r * r;
  vec s = fma_(z, splat(1.58969099521155010221e-10), splat(-2.50507602534068634195e-08));
  s = fma_(z, s, splat(2.75573137070700676789e-06));
  s = fma_(z, s, splat(-1.98412698298579493134e-04));
  s = fma_(z, s, splat(8.33333333332248946124e-03));
  s = fma_(z, s, splat(-1.66666666666666324348e-01));
  s = fma_(z * r, s, r);
  vec c = fma_(z, splat(-1.13596475577881948265e-11), splat(2.08757232129817482790e-09));
  c = fma_(z, c, splat(-2.75573143513906633035e-07));
  c = fma_(z, c, splat(2.48015872894767294178e-05));
  c = fma_(z, c, splat(-1.38888888888741095749e-03));
  c = fma_(z, c, splat(4.16666666666666019037e-02));
  c = fma_(z * z, c, fma_(z, splat(-0.5), splat(1.0)));
  const bits quadrant = as_bits(shifted);
  const bits swap = (as_bits(s) ^ as_bits(c)) & (0 - (quadrant & 1));
  *sine = as_vec(as_bits(s) ^ swap ^ ((quadrant & 2) << 62));
  *cosine = as_vec(as_bits(c) ^ swap ^ (((quadrant + 1) & 2) << 62));
}

/* Centres of a vector of links. */
typedef struct centres {
  vec x, y, vx, vy;
} centres;

/* A vector of links as their joints see them: directions, and the right ends. */
typedef struct ends {
  vec phi, vphi, cos, sin, x, y, vx, vy;
} ends;

/* Forces in the joints on the left of links, tension along +d, per mass of a link, and bending
 * moments per its moment of inertia; the power lost there. */
typedef struct forces {
  vec x, y, moment, loss;
} forces;

/* What the joints have in common. */
typedef struct joint_constants {
  vec half, arm, per_mass, damping_per_mass, per_inertia, damping_per_inertia;
  vec damping, bend_damping;
} joint_constants;

INLINE joint_constants joint_constants_of(const bd_links *links) {
  return (joint_constants){
      .half = splat(links->half),
      .arm = splat(links->half * links->inv_inertia / links->inv_mass),
      .per_mass = splat(links->stiffness * links->inv_mass),
      .damping_per_mass = splat(links->damping * links->inv_mass),
      .per_inertia = splat(links->bending * links->inv_inertia),
      .damping_per_inertia = splat(links->bending_damping * links->inv_inertia),
      .damping = splat(links->damping),
      .bend_damping = splat(links->bending_damping),
  };
}

INLINE ends ends_of(const centres *r, vec phi, vec vphi, vec half) {
  ends link = {.phi = phi, .vphi = vphi};
  const vec speed = half * vphi;
  sine_cosine(phi, &link.sin, &link.cos);
  link.x = fma_(half, link.cos, r->x);
  link.y = fma_(half, link.sin, r->y);
  link.vx = fma_(-speed, link.sin, r->vx);
  link.vy = fma_(speed, link.cos, r->vy);
  return link;
}

/* In the joints between links and those before them. */
INLINE forces joint_forces(const joint_constants *c, const centres *r, const ends *link,
                           const ends *before, const int bending, const int ledger) {
  const vec half = c->half, speed = half * link->vphi;
  const vec dx = fma_(-half, link->cos, r->x) - from_left(before->x, link->x);
  const vec dy = fma_(-half, link->sin, r->y) - from_left(before->y, link->y);
  const vec du = fma_(speed, link->sin, r->vx) - from_left(before->vx, link->vx);
  const vec dv = fma_(-speed, link->cos, r->vy) - from_left(before->vy, link->vy);
  forces f = {.x = fma_(c->per_mass, dx, c->damping_per_mass * du),
              .y = fma_(c->per_mass, dy, c->damping_per_mass * dv)};
  const vec turn = link->phi - from_left(before->phi, link->phi);
  const vec rate = link->vphi - from_left(before->vphi, link->vphi);
  if (bending) {
    f.moment = fma_(c->per_inertia, turn, c->damping_per_inertia * rate);
  }
  if (ledger) {
    f.loss = c->damping * fma_(du, du, dv * dv);
    f.loss = bending ? fma_(c->bend_damping * rate, rate, f.loss) : f.loss;
  }
  return f;
}

typedef struct rates {
  vec x, y, phi;
} rates;

/* (2.11) without contact: links between the joints on their left and on their right. */
INLINE rates accelerations(const ends *link, const forces *f, const forces *right, vec arm,
                           const int bending) {
  const vec turning = fma_(link->cos, f->y + right->y, -(link->sin * (f->x + right->x)));
  return (rates){right->x - f->x, right->y - f->y,
                 bending ? fma_(arm, turning, right->moment - f->moment) : arm * turning};
}

/* No rates: of the links' padding from `begin` on, and of the friction of all. */
INLINE void clear_others(const bd_layout *lay, double *out, int begin) {
  const int friction = bd_block(lay, F_MU) * lay->stride;
  for (int block = 0; block < friction; block += lay->stride) {
    for (int i = begin; i < lay->n8; i += WIDTH) {
      store(out + block + BD_HALO + i, (vec){0.0});
    }
  }
  for (int k = friction; k < lay->theta; k += WIDTH) {
    store(out + k, (vec){0.0});
  }
}

/* One pass: a vector's forces need the right end of the link before it, its accelerations the
 * joint after it, so each turn finishes the vector before. The ring is closed by taking the last
 * link's end first and the first joint's force last. */
INLINE double joints(const bd_links *links, const double *y, double *out, const int bending,
                     const int ledger) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, last = (n - 1) / WIDTH * WIDTH;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *phi = bd_cfield(lay, y, F_PHI), *vphi = bd_cfield(lay, y, F_VPHI);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  double *ox = bd_field(lay, out, F_X), *oy = bd_field(lay, out, F_Y);
  double *ophi = bd_field(lay, out, F_PHI), *ovphi = bd_field(lay, out, F_VPHI);
  double *ovx = bd_field(lay, out, F_VX), *ovy = bd_field(lay, out, F_VY);
  double *co = links->cos, *si = links->sin;
  const joint_constants c = joint_constants_of(links);
  const vec lane = lane_numbers();
  vec loss = {0.0};

  const centres end = {splat(x[n - 1]), splat(yy[n - 1]), splat(vx[n - 1]), splat(vy[n - 1])};
  ends before = ends_of(&end, splat(phi[n - 1]), splat(vphi[n - 1]), c.half);
  before.phi = splat(phi[n - 1] - links->wind);
  forces left = {0}, first = {0};
  for (int i = 0; i <= last; i += WIDTH) {
    const centres r = {load(x + i), load(yy + i), load(vx + i), load(vy + i)};
    const ends link = ends_of(&r, load(phi + i), load(vphi + i), c.half);
    const forces f = joint_forces(&c, &r, &link, &before, bending, ledger);
    store(co + i, link.cos);
    store(si + i, link.sin);
    store(ox + i, r.vx);
    store(oy + i, r.vy);
    store(ophi + i, link.vphi);
    if (ledger) {
      loss += left.loss;
    }
    if (i == 0) {
      first = (forces){.x = splat(first_of(f.x)),
                       .y = splat(first_of(f.y)),
                       .moment = splat(first_of(f.moment))};
    } else {
      const forces right = {.x = from_right(left.x, f.x),
                            .y = from_right(left.y, f.y),
                            .moment = from_right(left.moment, f.moment)};
      const rates a = accelerations(&before, &left, &right, c.arm, bending);
      store(ovx + i - WIDTH, a.x);
      store(ovy + i - WIDTH, a.y);
      store(ovphi + i - WIDTH, a.phi);
    }
    before = link;
    left = f;
  }
  /* the last vector: joint n is joint 0, and what lies past it stays at rest */
  const mask inner = less(lane, splat(n - 1 - last)), link_mask = less(lane, splat(n - last));
  const forces right = {.x = choose(inner, from_right(left.x, left.x), first.x),
                        .y = choose(inner, from_right(left.y, left.y), first.y),
                        .moment =
                            choose(inner, from_right(left.moment, left.moment), first.moment)};
  const rates a = accelerations(&before, &left, &right, c.arm, bending);
  store(ovx + last, where(link_mask, a.x));
  store(ovy + last, where(link_mask, a.y));
  store(ovphi + last, where(link_mask, a.phi));
  clear_others(lay, out, last + WIDTH);
  return ledger ? sum(loss + where(link_mask, left.loss)) : 0.0;
}

/* Contact of the links' centres with one pulley. A vector of links without contact costs one test
 * of distance. */
INLINE void contact(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                    const bd_run *runs, const double *y, double *dy, bd_sums *sums, const int law,
                    const int states, const int ledger, const int hunt_crossley) {
  const bd_layout *lay = &links->lay;
  const int friction = law != BD_LAW_NONE, at_states = bd_f_state(lay, pulley->slot);
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *zs = bd_cfield(lay, y, states != 0 ? at_states : F_X);
  double *ovx = bd_field(lay, dy, F_VX), *ovy = bd_field(lay, dy, F_VY);
  double *oz = bd_field(lay, dy, states != 0 ? at_states : F_X);
  double *oslip = bd_field(lay, dy, friction ? bd_f_slip(lay, pulley->slot) : F_Y);
  const vec cx = splat(pulley->x), cy = splat(pulley->y), cu = splat(pulley->vx),
            cv = splat(pulley->vy);
  const vec radius = splat(pulley->radius), rim2 = splat(pulley->radius * pulley->radius);
  const vec quadratic = splat(pulley->quadratic), linear = splat(pulley->linear);
  const contact_damping damping = contact_damping_of(pulley);
  const vec inv_mass = splat(links->inv_mass);
  const vec omega = splat(pulley->omega), none = {0.0};
  const law_constants constants = law_prepare(&pulley->friction, pulley->l0, law);
  vec torque = {0.0}, contact_loss = {0.0}, friction_loss = {0.0};

  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const vec dx = load(x + i) - cx, dy_ = load(yy + i) - cy;
      const vec rho2 = fma_(dx, dx, dy_ * dy_);
      const mask touch = less(rho2, rim2);
      if (!any(touch)) {
        continue; /* positions that are not finite show in the joints' forces */
      }
      vec rho, inv;
      root_and_inverse(rho2, &rho, &inv);
      const vec p = radius - rho;
      const vec nx = dx * inv, ny = dy_ * inv;
      const vec ux = load(vx + i) - cu, uy = load(vy + i) - cv;
      const vec closing = -fma_(ux, nx, uy * ny);
      const vec elastic = fma_(quadratic, p, linear) * p;
      const vec raw = fma_(damping_at(&damping, elastic, hunt_crossley), closing, elastic);
      const vec normal = where(touch, larger(raw, none));
      vec fx = normal * nx, fy = normal * ny;
      if (friction) {
        const vec slide = fma_(uy, nx, -(ux * ny)) - omega * rho;
        const vec v = where(touch, slide);
        const law_at at = {.v = v, .normal = normal, .touch = touch};
        const vec tangential = law_act(&constants, &at, pulley, zs, oz, i, NULL, law, states);
        fx = fma_(tangential, ny, fx);
        fy = fma_(-tangential, nx, fy);
        store(oslip + i, load(oslip + i) + v);
        torque = fma_(tangential, rho, torque);
        if (ledger) {
          friction_loss = fma_(tangential, v, friction_loss);
        }
      }
      if (ledger) {
        contact_loss += where(touch, (normal - elastic) * closing);
      }
      store(ovx + i, fma_(inv_mass, fx, load(ovx + i)));
      store(ovy + i, fma_(inv_mass, fy, load(ovy + i)));
    }
  }
  *sums = (bd_sums){.torque = sum(torque),
                    .contact_loss = sum(contact_loss),
                    .friction_loss = sum(friction_loss)};
}

#include "kernels/link_contact.h"
#include "kernels/string_belt.h"

#define JOINTS(bending, ledger)                                                                    \
  static double joints_##bending##ledger(const bd_links *links, const double *y, double *dy) {     \
    return joints(links, y, dy, bending, ledger);                                                  \
  }
#define ADD_NORMAL_FORCES(string, ledger)                                                          \
  static void add_normal_forces_##string##ledger(                                                  \
      const bd_links *links, const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,      \
      const bd_pressure *pressure, const bd_end_forces *out, const double *y, bd_sums *sums) {     \
    if (pulley->hunt_crossley > 0.0) {                                                             \
      add_normal_forces(links, pulley, n_runs, runs, pressure, out, y, sums, string, ledger, 1);   \
    } else {                                                                                       \
      add_normal_forces(links, pulley, n_runs, runs, pressure, out, y, sums, string, ledger, 0);   \
    }                                                                                              \
  }
#define NEAREST_ENDS(string)                                                                       \
  static void nearest_ends_##string(const bd_links *links, const bd_contact_pulley *pulley,        \
                                    int n_runs, const bd_run *runs, const double *y,               \
                                    double *nearest) {                                             \
    nearest_ends(links, pulley, n_runs, runs, y, nearest, string);                                 \
  }
#define CONTACT(law, states, ledger)                                                               \
  static void contact_##law##_##ledger(const bd_links *links, const bd_contact_pulley *pulley,     \
                                       int n_runs, const bd_run *runs, const double *y,            \
                                       double *dy, bd_sums *sums) {                                \
    if (pulley->hunt_crossley > 0.0) {                                                             \
      contact(links, pulley, n_runs, runs, y, dy, sums, BD_LAW_##law, states, ledger, 1);          \
    } else {                                                                                       \
      contact(links, pulley, n_runs, runs, y, dy, sums, BD_LAW_##law, states, ledger, 0);          \
    }                                                                                              \
  }
#define ADD_FRICTION(law, general, states, ledger)                                                 \
  static void add_friction_##law##_##ledger(                                                       \
      const bd_links *links, const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,      \
      const bd_points *points, const bd_pressure *pressure, const bd_end_forces *out,              \
      const double *y, double *dy, bd_sums *sums) {                                                \
    add_friction(links, pulley, n_runs, runs, points, pressure, out, y, dy, sums, BD_LAW_##law,    \
                 general, states, ledger);                                                         \
  }
JOINTS(0, 0)
JOINTS(0, 1)
JOINTS(1, 0)
JOINTS(1, 1)
ADD_NORMAL_FORCES(0, 0)
ADD_NORMAL_FORCES(0, 1)
ADD_NORMAL_FORCES(1, 1)
NEAREST_ENDS(0)
NEAREST_ENDS(1)
CONTACT(NONE, 0, 0)
CONTACT(NONE, 0, 1)
#define LAW(name, class, general, states, text)                                                    \
  CONTACT(name, states, 0)                                                                         \
  CONTACT(name, states, 1)                                                                         \
  ADD_FRICTION(name, general, states, 0) ADD_FRICTION(name, general, states, 1)
BD_LAWS(LAW)
#undef LAW

/* One law at one link, and what its header says of its parameters. */
#define LAW(name, class, general, states, text)                                                    \
  static void law_##name(const bd_friction *friction, double l0, int element, double z, double v,  \
                         double normal, bd_law_point *out) {                                       \
    const name##_constants c = name##_prepare(&friction->name, l0);                                \
    const law_at at = {splat(z), splat(v), splat(normal), less(splat(0.0), splat(1.0)), element};  \
    const law_value value = name##_value(&c, &at);                                                 \
    const law_slopes slopes = name##_slopes(&c, &at);                                              \
    *out = (bd_law_point){first_of(value.force),          first_of(value.rate),                    \
                          first_of(slopes.by_normal),     first_of(slopes.by_state),               \
                          first_of(slopes.by_slip),       first_of(slopes.rate_by_normal),         \
                          first_of(slopes.rate_by_state), first_of(slopes.rate_by_slip)};          \
  }                                                                                                \
  static double bound_##name(const bd_friction *friction) {                                        \
    return name##_bound(&friction->name);                                                          \
  }                                                                                                \
  static double kinetic_##name(const bd_friction *friction, int element) {                         \
    return name##_kinetic(&friction->name, element);                                               \
  }
BD_LAWS(LAW)
#undef LAW

/* The first block from `begin` on where something is to be done after a step; `end` if none. At
 * joints (`nearest`) contact is that of any end of the two links that meet there. */
INLINE int find_contact_event(const bd_links *links, const bd_contact_pulley *pulley, int index,
                              const double *owner, const double *nearest, const double *y,
                              int begin, int end, const int friction, const int of_joints) {
  const bd_layout *lay = &links->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *mu = bd_cfield(lay, y, friction ? bd_f_state(lay, pulley->slot) : F_X);
  const double *slip = bd_cfield(lay, y, friction ? bd_f_slip(lay, pulley->slot) : F_Y);
  const vec cx = splat(pulley->x), cy = splat(pulley->y), none = {0.0};
  const vec rim2 = splat(pulley->radius * pulley->radius), deep2 = splat(0.25) * rim2;
  const vec limit = splat(pulley->bound), id = splat(index), free = splat(-0.5);
  for (int block = begin; block < end; block += BD_LANES) {
    mask found = less(none, none);
    for (int i = block; i < block + BD_LANES; i += WIDTH) {
      const vec dx = load(x + i) - cx, dy = load(yy + i) - cy;
      vec rho2 = dx * dx + dy * dy;
      if (of_joints) {
        const vec one = load_unaligned(nearest + i - 1), other = load(nearest + i);
        rho2 = choose(less(one, other), one, other);
        rho2 = choose(less(none, load(links->link_mask + i)), rho2, splat(INFINITY));
      }
      found |= less(rho2, deep2);
      if (friction) {
        vec size = none, moved = magnitude(load(slip + i));
        const vec holder = load(owner + i);
        for (int e = 0; e < lay->states; ++e) {
          const vec z = magnitude(load(mu + e * lay->stride + i));
          size = e < law_elements(pulley, pulley->states) ? larger(z, size) : size;
          moved += z;
        }
        const mask in_contact = less(rho2, rim2), mine = less(magnitude(holder - id), splat(0.5));
        const mask not_reset = less(none, moved);
        found |= (in_contact ^ mine) | (in_contact & less(limit, size)) |
                 (less(holder, free) & not_reset);
      }
    }
    if (any(found)) {
      return block;
    }
  }
  return end;
}

#define EVENT(of_joints, friction)                                                                 \
  static int find_contact_event_##of_joints##friction(                                             \
      const bd_links *links, const bd_contact_pulley *pulley, int index, const double *owner,      \
      const double *nearest, const double *y, int begin, int end) {                                \
    return find_contact_event(links, pulley, index, owner, nearest, y, begin, end, friction,       \
                              of_joints);                                                          \
  }
EVENT(0, 0)
EVENT(0, 1)
EVENT(1, 0)
EVENT(1, 1)

static double fastest(const bd_layout *lay, const double *y) {
  const int cells = bd_has_field(lay, F_V); /* or nodes */
  const double *vx = bd_cfield(lay, y, cells ? F_V : F_VX);
  const double *vy = cells ? vx : bd_cfield(lay, y, F_VY);
  vec most = {0.0};
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec u = load(vx + i), v = load(vy + i);
    most = larger(u * u + v * v, most);
  }
  return largest(most);
}

/* The numbers of vectors that sums are made for, each with a loop of its own. */
#define COUNTS(X) X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8)
_Static_assert(MAX_VECTORS == 8, "COUNTS goes up to MAX_VECTORS");

INLINE void scaled(double h, const int m, const double *a, vec *ha) {
  for (int j = 0; j < m; ++j) {
    ha[j] = splat(h * a[j]);
  }
}

INLINE vec weighted_sum(size_t i, const int m, const vec *a, double *const *k) {
  vec total = a[0] * load(k[0] + i);
  for (int j = 1; j < m; ++j) {
    total = fma_(a[j], load(k[j] + i), total);
  }
  return total;
}

INLINE void combine_fixed(size_t n, double *restrict out, const double *restrict y, double h,
                          const int m, const double *a, double *const *k) {
  vec ha[MAX_VECTORS];
  scaled(h, m, a, ha);
  for (size_t i = 0; i < n; i += WIDTH) {
    store(out + i, load(y + i) + weighted_sum(i, m, ha, k));
  }
}

static void combine(size_t n, double *out, const double *y, double h, int m, const double *a,
                    double *const *k) {
  switch (m) {
#define CASE(count)                                                                                \
  case count:                                                                                      \
    combine_fixed(n, out, y, h, count, a, k);                                                      \
    break;
    COUNTS(CASE)
#undef CASE
  }
}

/* The largest squared error so far, and a total that goes non-finite with any error. */
typedef struct errors {
  vec worst, total;
} errors;

/* A single component at place i, or a vector whose second component stands `pair` further on. */
INLINE void weigh(size_t i, const size_t pair, const int m, const vec *e, double *const *k,
                  const double *w, errors *found) {
  const vec weight = load(w + i), one = weight * weighted_sum(i, m, e, k);
  vec square = one * one;
  if (pair) {
    const vec two = weight * weighted_sum(i + pair, m, e, k);
    square = fma_(two, two, square);
  }
  found->worst = larger(square, found->worst);
  found->total += square;
}

/* Of a block, or of two that are a vector's components. */
INLINE void weigh_block(const bd_layout *lay, int field, const int is_vector, const int m,
                        const vec *e, double *const *k, const double *w, errors *found) {
  const size_t stride = (size_t)lay->stride;
  const size_t begin = (size_t)bd_block(lay, field) * stride + BD_HALO;
  for (size_t i = begin; i < begin + (size_t)lay->n; i += WIDTH) {
    weigh(i, is_vector ? stride : 0, m, e, k, w, found);
  }
}

INLINE double error_fixed(const bd_layout *lay, double h, const int m, const double *e,
                          double *const *k, const double *w) {
  vec he[MAX_VECTORS];
  scaled(h, m, e, he);
  const vec none = {0.0};
  errors found = {none, none};
  for (int f = 0; f < bd_f_slip(lay, 0); ++f) {
    if (bd_has_field(lay, f) && (f == F_X || f == F_VX)) {
      weigh_block(lay, f++, 1, m, he, k, w, &found);
    } else if (bd_has_field(lay, f)) {
      weigh_block(lay, f, 0, m, he, k, w, &found);
    }
  }
  for (size_t i = (size_t)lay->theta; i < lay->size; i += WIDTH) {
    weigh(i, 0, m, he, k, w, &found);
  }
  return isfinite(sum(found.total)) ? sqrt(largest(found.worst)) : INFINITY;
}

static double error_norm(const bd_layout *lay, double h, int m, const double *e, double *const *k,
                         const double *w) {
  switch (m) {
#define CASE(count)                                                                                \
  case count:                                                                                      \
    return error_fixed(lay, h, count, e, k, w);
    COUNTS(CASE)
#undef CASE
  }
  return INFINITY; /* no such number of vectors */
}

extern const bd_newton_kernels PASTE(bd_newton_, BD_LEVEL), PASTE(bd_newton_centres_, BD_LEVEL),
    PASTE(bd_newton_string_, BD_LEVEL);

extern const bd_ale_kernels PASTE(bd_ale_, BD_LEVEL);

#define STRING2(a) #a
#define STRING(a) STRING2(a)
#define SHARED                                                                                     \
  .level = STRING(BD_LEVEL), .law = {BD_LAWS(LAW_AT)}, .bound = {BD_LAWS(BOUND)},                  \
  .kinetic = {BD_LAWS(KINETIC)}, .fastest = fastest, .combine = combine, .error_norm = error_norm
#define LAW_AT(name, class, general, states, text) [BD_LAW_##name] = law_##name,
#define BOUND(name, class, general, states, text) [BD_LAW_##name] = bound_##name,
#define KINETIC(name, class, general, states, text) [BD_LAW_##name] = kinetic_##name,
#define CENTRES(name, class, general, states, text)                                                \
  [BD_LAW_##name] = {contact_##name##_0, contact_##name##_1},
#define LINK_FRICTION(name, class, general, states, text)                                          \
  [BD_LAW_##name] = {add_friction_##name##_0, add_friction_##name##_1},
#define BARS(name, class, general, states, text)                                                   \
  [BD_LAW_##name] = {string_contact_##name##_0, string_contact_##name##_1},
#define RIGID_LINKS .joints = {{joints_00, joints_01}, {joints_10, joints_11}}
#define ALONG .find_contact_event = {find_contact_event_10, find_contact_event_11}

const bd_kernels PASTE(bd_kernels_, BD_LEVEL)[BD_N_BELT_MODELS] = {
    [BD_BELT_MODEL_joint] = {SHARED, RIGID_LINKS, ALONG, .newton = &PASTE(bd_newton_, BD_LEVEL),
                             .add_normal_forces = {add_normal_forces_00, add_normal_forces_01},
                             .add_friction = {BD_LAWS(LINK_FRICTION)},
                             .nearest_ends = nearest_ends_0, .directions = directions,
                             .gather_points = gather_points, .scatter_forces = scatter_forces,
                             .sum_forces = sum_forces},
    [BD_BELT_MODEL_string] = {SHARED, ALONG, .newton = &PASTE(bd_newton_string_, BD_LEVEL),
                              .joints = {{string_joints_0, string_joints_1}},
                              .contact = {{string_contact_NONE_0, string_contact_NONE_1},
                                          BD_LAWS(BARS)},
                              .add_normal_forces = {NULL, add_normal_forces_11},
                              .nearest_ends = nearest_ends_1},
    [BD_BELT_MODEL_paper] = {SHARED, RIGID_LINKS, .newton = &PASTE(bd_newton_centres_, BD_LEVEL),
                             .contact = {{contact_NONE_0, contact_NONE_1}, BD_LAWS(CENTRES)},
                             .find_contact_event = {find_contact_event_00, find_contact_event_01}},
    [BD_BELT_MODEL_ale] = {SHARED, .ale = &PASTE(bd_ale_, BD_LEVEL)},
};
