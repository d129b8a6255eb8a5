/* SPDX-License-Identifier: MIT
 *
 * The belt as a string (MODEL section 2): point masses joined by bars that stretch along their
 * chord. Its part of the rate, compiled once per instruction level, in rhs.h; contact along the
 * bars is that of link_contact.h. Joint i is the bar between mass i - 1 and mass i.
 */

/* Masses as their bars see them. */
typedef struct masses {
  vec x, y, vx, vy;
} masses;

/* Pull of the bars on the masses before them, per mass, their directions and the power lost. */
typedef struct pulls {
  vec x, y, ux, uy, loss;
} pulls;

INLINE pulls bar_pulls(const bd_links *links, const masses *here, const masses *before,
                       const int ledger) {
  const vec dx = here->x - from_left(before->x, here->x);
  const vec dy = here->y - from_left(before->y, here->y);
  const vec du = here->vx - from_left(before->vx, here->vx);
  const vec dv = here->vy - from_left(before->vy, here->vy);
  vec length, inv;
  root_and_inverse(fma_(dx, dx, dy * dy), &length, &inv);
  pulls p = {.ux = dx * inv, .uy = dy * inv};
  const vec rate = fma_(p.ux, du, p.uy * dv);
  const vec stretch = length - splat(2.0 * links->half);
  const vec pull = fma_(splat(links->stiffness * links->inv_mass), stretch,
                        splat(links->damping * links->inv_mass) * rate);
  p.x = pull * p.ux;
  p.y = pull * p.uy;
  if (ledger) {
    p.loss = splat(links->damping) * rate * rate;
  }
  return p;
}

/* In one pass, as that of links: the bar behind a mass is the next one's. */
INLINE double string_joints(const bd_links *links, const double *y, double *out, const int ledger) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, last = (n - 1) / WIDTH * WIDTH;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  double *ox = bd_field(lay, out, F_X), *oy = bd_field(lay, out, F_Y);
  double *ovx = bd_field(lay, out, F_VX), *ovy = bd_field(lay, out, F_VY);
  const vec lane = lane_numbers();
  vec loss = {0.0}, first_x = {0.0}, first_y = {0.0};
  masses before = {splat(x[n - 1]), splat(yy[n - 1]), splat(vx[n - 1]), splat(vy[n - 1])};
  pulls left = {0};
  for (int i = 0; i <= last; i += WIDTH) {
    const masses here = {load(x + i), load(yy + i), load(vx + i), load(vy + i)};
    const pulls p = bar_pulls(links, &here, &before, ledger);
    store(links->cos + i, p.ux);
    store(links->sin + i, p.uy);
    store(ox + i, here.vx);
    store(oy + i, here.vy);
    if (ledger) {
      loss += left.loss;
    }
    if (i == 0) {
      first_x = splat(first_of(p.x));
      first_y = splat(first_of(p.y));
    } else {
      store(ovx + i - WIDTH, from_right(left.x, p.x) - left.x);
      store(ovy + i - WIDTH, from_right(left.y, p.y) - left.y);
    }
    before = here;
    left = p;
  }
  /* the last vector: bar n is bar 0, and what lies past it stays at rest */
  const mask inner = less(lane, splat(n - 1 - last)), mass = less(lane, splat(n - last));
  const vec right_x = choose(inner, from_right(left.x, left.x), first_x);
  const vec right_y = choose(inner, from_right(left.y, left.y), first_y);
  store(ovx + last, where(mass, right_x - left.x));
  store(ovy + last, where(mass, right_y - left.y));
  clear_others(lay, out, last + WIDTH);
  return ledger ? sum(loss + where(mass, left.loss)) : 0.0;
}

static double string_joints_0(const bd_links *links, const double *y, double *dy) {
  return string_joints(links, y, dy, 0);
}

static double string_joints_1(const bd_links *links, const double *y, double *dy) {
  return string_joints(links, y, dy, 1);
}

/* The masses of a block as a pulley sees them. */
INLINE link_end mass_ends(const bd_layout *lay, const bd_contact_pulley *pulley, const double *y,
                          int i, vec radius) {
  return end_of(load(bd_cfield(lay, y, F_X) + i) - splat(pulley->x),
                load(bd_cfield(lay, y, F_Y) + i) - splat(pulley->y),
                load(bd_cfield(lay, y, F_VX) + i) - splat(pulley->vx),
                load(bd_cfield(lay, y, F_VY) + i) - splat(pulley->vy), radius);
}

INLINE link_end one_end(const bd_layout *lay, const bd_contact_pulley *pulley, const double *y,
                        int i, vec radius) {
  return end_of(splat(bd_cfield(lay, y, F_X)[i] - pulley->x),
                splat(bd_cfield(lay, y, F_Y)[i] - pulley->y),
                splat(bd_cfield(lay, y, F_VX)[i] - pulley->vx),
                splat(bd_cfield(lay, y, F_VY)[i] - pulley->vy), radius);
}

/* What contact along the bars needs of the right end of each: the mass behind. `next` is the block
 * behind, that of the first mass behind the last one; the padding sees itself. */
INLINE link_end ends_behind(const bd_layout *lay, int i, const link_end *here,
                            const link_end *next) {
  link_end after = {.p = from_right(here->p, next->p), .rate = from_right(here->rate, next->rate)};
  if (i + WIDTH >= lay->n) {
    const vec lane = lane_numbers();
    const mask inner = less(lane, splat(lay->n - 1 - i)), mass = less(lane, splat(lay->n - i));
    const vec p = splat(first_of(next->p)), rate = splat(first_of(next->rate));
    after.p = choose(inner, after.p, choose(mass, p, here->p));
    after.rate = choose(inner, after.rate, choose(mass, rate, here->rate));
  }
  return after;
}

/* So many blocks of masses are looked at before their bars are: their roots do not wait for each
 * other. */
enum { BLOCKS = 8 };

/* Contact along the bars of the runs and friction at their masses, with one pulley, in one pass. A
 * mass needs the bar before it, which the registers of the block before have; runs are apart by
 * more than a bar that touches. */
INLINE void string_contact(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                           const bd_run *runs, const double *y, double *dy, bd_sums *sums,
                           const int law, const int general, const int states, const int ledger,
                           const int hunt_crossley) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, friction = law != BD_LAW_NONE;
  const vec radius = splat(pulley->radius), none = splat(0.0), lane = lane_numbers();
  const mask every = less(lane, splat(WIDTH));
  const vec inv_mass = splat(links->inv_mass), omega = splat(pulley->omega);
  const int at_states = states != 0 ? bd_f_state(lay, pulley->slot) : F_X;
  const double *zs = bd_cfield(lay, y, at_states);
  double *ovx = bd_field(lay, dy, F_VX), *ovy = bd_field(lay, dy, F_VY);
  double *oz = bd_field(lay, dy, at_states);
  double *oslip = bd_field(lay, dy, friction ? bd_f_slip(lay, pulley->slot) : F_Y);
  const law_constants constants = law_prepare(&pulley->friction, pulley->l0, law);
  vec torque = none, friction_loss = none, contact_loss = none, energy = none;
  vec sum_x = none, sum_y = none;
  for (int r = 0; r < n_runs; ++r) {
    normal_forces before = {none, none, none, none, none, none};
    if (runs[r].begin == 0 && runs[n_runs - 1].end >= n) {
      const link_end end = one_end(lay, pulley, y, n - 1, radius);
      const link_end first = one_end(lay, pulley, y, 0, radius);
      vec counted[2] = {none, none}; /* with the last bar */
      before = link_normal_forces(pulley, &end, &first, 0, hunt_crossley, &counted[0], &counted[1]);
    }
    link_end at[BLOCKS + 1];
    /* runs end at whole BD_LANES: the blocks behind the last mass would lose power once more */
    const int stop = runs[r].end < n ? runs[r].end : n;
    for (int i = runs[r].begin, k = BLOCKS; i < stop; i += WIDTH, ++k) {
      if (k == BLOCKS) {
        const int blocks = (runs[r].end - i) / WIDTH;
        for (k = 0; k <= (blocks < BLOCKS ? blocks : BLOCKS); ++k) {
          const int place = i + k * WIDTH;
          at[k] = mass_ends(lay, pulley, y, place < n ? place : 0, radius);
        }
        k = 0;
      }
      const link_end here = at[k], after = ends_behind(lay, i, &here, &at[k + 1]);
      const mask mass = less(lane, splat(n - i));
      /* a mass on the axis has no penetration that is a number, and must show it */
      const mask off = less(here.p, none) & less(after.p, none);
      if (!any(except(every, off) | less(none, before.share_right))) {
        before = (normal_forces){none, none, none, none, none, none};
        continue;
      }
      const normal_forces bar =
          link_normal_forces(pulley, &here, &after, ledger, hunt_crossley, &contact_loss, &energy);
      const vec normal = where(mass, bar.left + from_left(before.right, bar.right));
      vec fx = normal * here.nx, fy = normal * here.ny;
      if (friction) {
        const vec share = bar.share_left + from_left(before.share_right, bar.share_right);
        const vec fresh = bar.rate_left + from_left(before.rate_right, bar.rate_right);
        const mask touch = mass & less(none, share);
        const vec rho = radius - here.p;
        const vec v = where(touch, fnma_(omega, rho, here.around));
        const vec pressing = general ? where(touch, normal / choose(touch, share, splat(1.0)))
                                     : where(touch, normal);
        vec diluted = none;
        if (states != 0 && any(touch & less(none, fresh))) {
          diluted = where(touch, larger(fresh, none) / (share + splat(FRESH)));
        }
        const law_at acting = {.v = v, .normal = pressing, .touch = touch};
        const vec mean = law_act(&constants, &acting, pulley, zs, oz, i, &diluted, law, states);
        const vec force = general ? where(touch, mean * share) : mean;
        store(oslip + i, load(oslip + i) + v);
        fx = fma_(force, here.ny, fx);
        fy = fnma_(force, here.nx, fy);
        torque = fma_(force, rho, torque);
        if (ledger) {
          friction_loss = fma_(force, v, friction_loss);
        }
      }
      store(ovx + i, fma_(inv_mass, fx, load(ovx + i)));
      store(ovy + i, fma_(inv_mass, fy, load(ovy + i)));
      sum_x += fx;
      sum_y += fy;
      before = bar;
    }
  }
  *sums = (bd_sums){.torque = sum(torque),
                    .contact_loss = sum(contact_loss),
                    .friction_loss = sum(friction_loss),
                    .contact_energy = sum(energy),
                    .force = {sum(sum_x), sum(sum_y)}};
}

#define STRING_CONTACT(law, general, states, ledger)                                               \
  static void string_contact_##law##_##ledger(                                                     \
      const bd_links *links, const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,      \
      const double *y, double *dy, bd_sums *sums) {                                                \
    if (pulley->hunt_crossley > 0.0) {                                                             \
      string_contact(links, pulley, n_runs, runs, y, dy, sums, BD_LAW_##law, general, states,      \
                     ledger, 1);                                                                   \
    } else {                                                                                       \
      string_contact(links, pulley, n_runs, runs, y, dy, sums, BD_LAW_##law, general, states,      \
                     ledger, 0);                                                                   \
    }                                                                                              \
  }
#define LAW(name, class, general, states, text)                                                    \
  STRING_CONTACT(name, general, states, 0) STRING_CONTACT(name, general, states, 1)
STRING_CONTACT(NONE, 0, 0, 0)
STRING_CONTACT(NONE, 0, 0, 1)
BD_LAWS(LAW)
#undef LAW
