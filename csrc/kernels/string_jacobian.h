/* SPDX-License-Identifier: MIT
 *
 * The string of point masses (string_belt.h) in the linear systems, compiled once per instruction
 * level, in jacobian.h. Two unknowns a mass, in 2 x 2 blocks round the ring.
 *
 * The bar before mass i has the direction u, the normal n, the length l and the pull T; with
 * d = r_i - r_{i-1}, w = v_i - v_{i-1}
 *
 *   d(T u) = u (c u.dd + b u.dw + (b n.w / l) n.dd) + (T / l) n (n.dd)
 *
 * Contact acts on mass i by N n - F t at its place. N and F depend on p and p' of the mass before,
 * of itself and of the one behind, dp = -n.dr, dp' = -n.dv - (v_t / rho) t.dr (contact along the
 * bars, as linearised by link_contact_tangent.h); F on the slip of the mass itself as well.
 */

/* As seen from the masses from i on, what stands in v with those before them. */
INLINE vec of_previous(const double *v, int i, int n) {
  const vec previous = load_unaligned(v + i - 1);
  return i > 0 ? previous : choose(less(lane_numbers(), splat(1.0)), splat(v[n - 1]), previous);
}

/* --- bars ------------------------------------------------------------------------------------ */

/* Of a bar: direction into cos and sin, b n.w / l into spin, T / l into pull. */
static void string_linearise_joints(const bd_links *links, const double *y,
                                    const bd_tangent *tangent) {
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

/* All blocks without contact. */
static void string_diagonal(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                            const bd_blocks *blocks) {
  const int n = links->lay.n, n8 = links->lay.n8;
  const bd_tangent t = *tangent;
  const bd_blocks b = *blocks;
  const vec g2 = splat(stage->g * stage->g), along = splat(b.k), mass = splat(stage->mass);
  const vec none = splat(0.0);
  for (int i = 0; i < n8; i += WIDTH) {
    const plane_block bar = turned_back(load(t.cos + i), load(t.sin + i), along,
                                        g2 * load(t.spin + i), none, g2 * load(t.pull + i));
    const vec entries[4] = {-bar.xx, -bar.xy, -bar.yx, -bar.yy};
    for (int k = 0; k < 4; ++k) {
      store(b.back[k] + i, entries[k]);
      store(b.forward[k] + i, entries[k]);
    }
  }
  double *const diagonal[4] = {b.xx, b.xy, b.yx, b.yy};
  for (int i = 0; i < n8; i += WIDTH) {
    for (int k = 0; k < 4; ++k) {
      const vec both = load(b.back[k] + i) + of_next(b.back[k], i, n);
      store(diagonal[k] + i, k % 3 == 0 ? mass - both : -both);
    }
  }
}

/* r = M b_v + g F_q b_q of the bars, b = g c. */
static void string_joints_product(const bd_links *links, const bd_tangent *tangent,
                                  const bd_stage *stage, const double *c, double *x, double *y,
                                  double *p) {
  (void)p;
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const int n = lay->n, n8 = lay->n8;
  const double *cx = bd_cfield(lay, c, F_X), *cy = bd_cfield(lay, c, F_Y);
  const double *cvx = bd_cfield(lay, c, F_VX), *cvy = bd_cfield(lay, c, F_VY);
  const vec g2 = splat(stage->g * stage->g), stiffness = splat(links->stiffness);
  const vec mass = splat(stage->g / links->inv_mass);
  for (int i = 0; i < n8; i += WIDTH) {
    const plane_block bar = turned_back(load(t.cos + i), load(t.sin + i), stiffness,
                                        load(t.spin + i), splat(0.0), load(t.pull + i));
    const vec dx = load(cx + i) - of_previous(cx, i, n);
    const vec dy = load(cy + i) - of_previous(cy, i, n);
    store(links->fx + i, fma_(bar.xx, dx, bar.xy * dy));
    store(links->fy + i, fma_(bar.yx, dx, bar.yy * dy));
  }
  for (int i = 0; i < n8; i += WIDTH) {
    const vec fx = of_next(links->fx, i, n) - load(links->fx + i);
    const vec fy = of_next(links->fy, i, n) - load(links->fy + i);
    store(x + i, fma_(g2, fx, mass * load(cvx + i)));
    store(y + i, fma_(g2, fy, mass * load(cvy + i)));
  }
}

/* From the masses' velocities without the pulleys' to all their unknowns, as finish_links. */
static void string_finish_links(const bd_links *links, const bd_stage *stage, int n_columns,
                                const double *columns, const double *factors, const double *x,
                                const double *y, const double *p, double *c) {
  (void)p;
  const bd_layout *lay = &links->lay;
  const size_t stride = (size_t)lay->stride;
  const vec g = splat(stage->g), none = splat(0.0);
  double *cx = bd_field(lay, c, F_X), *cvx = bd_field(lay, c, F_VX);
  double *cmu = bd_field(lay, c, F_MU);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const mask mass = less(none, load(links->link_mask + i));
    vec v[2] = {load(x + i), load(y + i)};
    for (int k = 0; k < 2; ++k) {
      for (int j = 0; j < n_columns; ++j) {
        const double *column = columns + (size_t)(3 * j + k) * stride;
        v[k] = fnma_(splat(factors[j]), load(column + i), v[k]);
      }
      const size_t at = (size_t)k * stride + (size_t)i;
      store(cx + at, where(mass, g * (load(cx + at) + v[k])));
      store(cvx + at, where(mass, v[k]));
    }
    for (int k = 0; k < lay->slots * (lay->states + 1); ++k) {
      const size_t at = (size_t)k * stride + (size_t)i;
      store(cmu + at, where(mass, g * load(cmu + at)));
    }
  }
}

/* --- contact --------------------------------------------------------------------------------- */

/* The contact of a mass as linearised: normals and v_t / rho of the mass before, of itself, of the
 * one behind; N and F, for one g, and the state of friction by their p and p'. */
typedef struct mass_linear {
  vec nx[3], ny[3], around[3], normal_over_rho;
  vec normal_by[3][2], friction_by[3][2];
  joint_linear friction;
} mass_linear;

/* What stands with the two bars of a mass by (p_a, p_b, p_a', p_b') of each, by masses. */
INLINE void by_masses(const vec *before, const vec *after, vec by[3][2]) {
  for (int rate = 0; rate < 2; ++rate) {
    by[0][rate] = before[2 * rate];
    by[1][rate] = before[2 * rate + 1] + after[2 * rate];
    by[2][rate] = after[2 * rate + 1];
  }
}

INLINE void load_by_masses(double *const *by_bars, int i, vec by[3][2]) {
  vec at[8];
  for (int m = 0; m < 8; ++m) {
    at[m] = load(by_bars[m] + i);
  }
  by_masses(at, at + 4, by);
}

INLINE mass_linear mass_linear_of(const bd_link_tangent *t, const bd_contact_pulley *pulley,
                                  int i) {
  mass_linear mass = {.normal_over_rho = load(t->normal_over_rho[0] + i) +
                                         load_unaligned(t->normal_over_rho[1] + i - 1)};
  vec before[4], after[4];
  for (int m = 0; m < 4; ++m) {
    before[m] = load_unaligned(t->by[4 + m] + i - 1);
    after[m] = load(t->by[m] + i);
  }
  by_masses(before, after, mass.normal_by);
  for (int m = 0; m < 3; ++m) { /* left ends of the bar before and of its own, right end of that */
    const int end = m == 2, at = m == 0 ? i - 1 : i;
    mass.nx[m] = load_unaligned(t->nx[end] + at);
    mass.ny[m] = load_unaligned(t->ny[end] + at);
    mass.around[m] = load_unaligned(t->around[end] + at);
  }
  if (pulley->law != BD_LAW_NONE) {
    mass.friction = joint_linear_of(t, pulley, i);
  }
  return mass;
}

INLINE vec penetration_product(const mass_linear *mass, const int m, const end_move *move,
                               vec by[3][2]) {
  const vec nx = mass->nx[m], ny = mass->ny[m];
  const vec p = -fma_(nx, move->x, ny * move->y);
  const vec turned = fnma_(ny, move->x, nx * move->y);
  const vec rate = -fma_(mass->around[m], turned, fma_(nx, move->vx, ny * move->vy));
  return fma_(by[m][0], p, by[m][1] * rate);
}

/* Normal force on the mass by a move of mass m of the three. */
INLINE end_move normal_by(mass_linear *mass, const int m, const end_move *move) {
  const vec more = penetration_product(mass, m, move, mass->normal_by);
  const vec nx = mass->nx[1], ny = mass->ny[1];
  end_move force = {.x = more * nx, .y = more * ny};
  if (m == 1) {
    const vec along = mass->normal_over_rho * fnma_(ny, move->x, nx * move->y);
    force.x = fnma_(along, ny, force.x);
    force.y = fma_(along, nx, force.y);
  }
  return force;
}

/* Friction on it, and its torque on the pulley; `more` is added to the friction force. */
INLINE joint_force mass_friction_by(mass_linear *mass, const int m, const end_move *move,
                                    vec more) {
  const end_move still = {0};
  more += penetration_product(mass, m, move, mass->friction_by);
  if (m == 1) {
    more = fma_(mass->friction.slip, slip_of(&mass->friction, move, 1.0), more);
  }
  return friction_by(&mass->friction, m == 1 ? move : &still, more, 1.0);
}

INLINE end_move unit_velocity(vec g, const int unknown) {
  const vec one = splat(1.0), none = splat(0.0);
  return unknown == 0 ? (end_move){g, none, one, none} : (end_move){none, g, none, one};
}

/* Where columns of the three masses are collected: by the mass on which the force acts. */
INLINE double *row_part(const bd_link_scratch *scratch, const int m, const int k) {
  return m == 2 ? (k == 0 ? scratch->row_before[2] : scratch->row_behind[2])
                : (m == 0 ? scratch->row_before[k] : scratch->row_behind[k]);
}

INLINE void string_gather_row(const bd_layout *lay, const double *link_mask,
                              const bd_link_scratch *scratch, double *row) {
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const mask mass = less(splat(0.0), load(link_mask + i));
    for (int k = 0; k < 2; ++k) {
      const vec entry = of_next(row_part(scratch, 0, k), i, lay->n) +
                        load(row_part(scratch, 1, k) + i) +
                        of_previous(row_part(scratch, 2, k), i, lay->n);
      store(row + (size_t)k * (size_t)lay->stride + i, where(mass, entry));
    }
  }
}

static double string_add_links(const bd_links *links, const bd_tangent *tangent,
                               const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                               const bd_link_tangent *contact, double g, const bd_blocks *blocks,
                               const bd_link_scratch *scratch, double *column_x, double *column_y,
                               double *row) {
  (void)tangent;
  const bd_link_tangent *t = contact;
  const bd_blocks b = *blocks;
  const int friction = pulley->law != BD_LAW_NONE;
  const vec step = splat(g), none = splat(0.0);
  /* by the mass behind: in the place of the mass on which the force acts (string_assemble) */
  double *const to[3][4] = {
      {b.back[0], b.back[1], b.back[2], b.back[3]},
      {b.xx, b.xy, b.yx, b.yy},
      {scratch->behind[0], scratch->behind[1], scratch->behind[2], scratch->behind[3]}};
  vec own = none;
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      vec total[8];
      if (friction) {
        eliminate_states(pulley, t, i, step, total);
      }
      mass_linear mass = mass_linear_of(t, pulley, i);
      if (friction) {
        by_masses(total, total + 4, mass.friction_by);
        own += add_spin(&mass.friction, i, step, column_x, column_y);
      }
      for (int m = 0; m < 3; ++m) {
        for (int k = 0; k < 2; ++k) {
          const end_move move = unit_velocity(step, k);
          end_move force = normal_by(&mass, m, &move);
          if (friction) {
            const joint_force f = mass_friction_by(&mass, m, &move, none);
            force.x += f.x;
            force.y += f.y;
            store(row_part(scratch, m, k) + i, -step * f.torque);
          }
          add_to(to[m][k], i, -step * force.x);
          add_to(to[m][2 + k], i, -step * force.y);
        }
      }
    }
  }
  if (friction) {
    string_gather_row(&links->lay, links->link_mask, scratch, row);
  }
  return sum(own);
}

/* What couples a mass to the one behind it stands with that one in the ring's blocks. */
static void string_assemble(const bd_links *links, const bd_tangent *tangent, double g,
                            const bd_link_scratch *scratch, const bd_blocks *blocks) {
  (void)tangent, (void)g;
  for (int i = 0; i < links->lay.n8; i += WIDTH) {
    for (int k = 0; k < 4; ++k) {
      add_to(blocks->forward[k], i, of_previous(scratch->behind[k], i, links->lay.n));
    }
  }
}

static void string_joints_to_links(const bd_links *links, const bd_tangent *tangent, double *fx,
                                   double *fy, double *x, double *y, double *p) {
  (void)tangent, (void)p;
  for (int i = 0; i < links->lay.n8; i += WIDTH) {
    add_to(x, i, load(fx + i));
    add_to(y, i, load(fy + i));
  }
}

/* The moves of the mass before, of a mass itself and of the one behind as c has them, with or
 * without velocities. */
INLINE void moves_in(const bd_layout *lay, const double *c, int i, const int solved,
                     end_move moves[3]) {
  const double *x = bd_cfield(lay, c, F_X), *y = bd_cfield(lay, c, F_Y);
  const double *vx = bd_cfield(lay, c, F_VX), *vy = bd_cfield(lay, c, F_VY);
  const vec none = splat(0.0);
  const int n = lay->n;
  moves[0] =
      (end_move){of_previous(x, i, n), of_previous(y, i, n), solved ? of_previous(vx, i, n) : none,
                 solved ? of_previous(vy, i, n) : none};
  moves[1] = (end_move){load(x + i), load(y + i), solved ? load(vx + i) : none,
                        solved ? load(vy + i) : none};
  moves[2] = (end_move){of_next(x, i, n), of_next(y, i, n), solved ? of_next(vx, i, n) : none,
                        solved ? of_next(vy, i, n) : none};
}

/* Forces by moves of all three; `given` is added to the friction force. */
typedef struct mass_forces {
  vec x, y;             /* normal */
  joint_force friction; /* and its torque */
} mass_forces;

INLINE mass_forces forces_by(mass_linear *mass, const end_move moves[3], vec given,
                             const int friction) {
  mass_forces sum = {0};
  for (int m = 0; m < 3; ++m) {
    const end_move f = normal_by(mass, m, &moves[m]);
    sum.x += f.x;
    sum.y += f.y;
    if (friction) {
      const joint_force d = mass_friction_by(mass, m, &moves[m], m == 1 ? given : splat(0.0));
      sum.friction.x += d.x;
      sum.friction.y += d.y;
      sum.friction.torque += d.torque;
    }
  }
  return sum;
}

static double string_link_product(const bd_links *links, const bd_tangent *tangent,
                                  const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                                  const bd_link_tangent *contact, double g, const double *c,
                                  double *fx, double *fy, double *x, double *y, double *p) {
  (void)tangent, (void)p;
  const bd_layout *lay = &links->lay;
  const int friction = pulley->law != BD_LAW_NONE;
  const double *cz = bd_cfield(lay, c, bd_f_state(lay, pulley->slot));
  const vec g2 = splat(g * g);
  vec torque = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      mass_linear mass = mass_linear_of(contact, pulley, i);
      vec given = splat(0.0);
      if (friction) {
        load_by_masses(contact->total, i, mass.friction_by);
        for (int k = i; k < i + pulley->states * pulley->stride; k += pulley->stride) {
          given = fma_(load(contact->given_state + k), load(cz + k), given);
        }
      }
      end_move moves[3];
      moves_in(lay, c, i, 0, moves);
      const mass_forces f = forces_by(&mass, moves, given, friction);
      add_to(x, i, g2 * f.x);
      add_to(y, i, g2 * f.y);
      if (friction) {
        add_to(fx, i, g2 * f.friction.x);
        add_to(fy, i, g2 * f.friction.y);
        torque = fma_(g2, f.friction.torque, torque);
      }
    }
  }
  return sum(torque);
}

static void string_add_turning(const bd_layout *lay, const double *turning, double g,
                               const double *c, double *p) {
  (void)lay, (void)turning, (void)g, (void)c, (void)p;
}

/* A state of friction of the masses, in the rows at place k, by moves of the three. */
INLINE vec state_by(const bd_link_tangent *t, mass_linear *mass, int k, const end_move moves[3],
                    vec slide) {
  load_by_masses(t->state_by, k, mass->friction_by);
  vec z = load(t->state_by_slip + k) * slide;
  for (int m = 0; m < 3; ++m) {
    z += penetration_product(mass, m, &moves[m], mass->friction_by);
  }
  return z;
}

static void string_finish_joints(const bd_links *links, const bd_tangent *tangent,
                                 const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                                 const bd_link_tangent *contact, double g,
                                 double angular_acceleration, double *c) {
  (void)tangent;
  const bd_layout *lay = &links->lay;
  double *cz = bd_field(lay, c, bd_f_state(lay, pulley->slot));
  double *cslip = bd_field(lay, c, bd_f_slip(lay, pulley->slot));
  const vec spin = splat(angular_acceleration), step = splat(g), none = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const mask link = less(none, load(links->link_mask + i));
      mass_linear mass = mass_linear_of(contact, pulley, i);
      end_move moves[3];
      moves_in(lay, c, i, 1, moves);
      vec slide = slip_of(&mass.friction, &moves[1], 1.0);
      slide = where(less(none, mass.friction.rho), fnma_(mass.friction.rho, spin, slide));
      for (int k = i; k < i + pulley->states * pulley->stride; k += pulley->stride) {
        const vec z = fma_(load(contact->decay_factor + k), load(cz + k),
                           state_by(contact, &mass, k, moves, slide));
        store(cz + k, where(link, z));
      }
      store(cslip + i, where(link, fma_(step, slide, load(cslip + i))));
    }
  }
}

static double string_ring_product(const bd_layout *lay, const double *const row[3], const double *x,
                                  const double *y, const double *p) {
  (void)p;
  vec total = splat(0.0);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    total = fma_(load(row[0] + i), load(x + i), total);
    total = fma_(load(row[1] + i), load(y + i), total);
  }
  return sum(total);
}

/* --- pulleys whose axes move (link_mount.h) --------------------------------------------------- */

INLINE void all_masses(const double move[4], end_move moves[3]) {
  for (int m = 0; m < 3; ++m) {
    moves[m] = (end_move){splat(move[0]), splat(move[1]), splat(move[2]), splat(move[3])};
  }
}

static double string_move_links(const bd_links *links, const bd_tangent *tangent,
                                const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                                const bd_link_tangent *contact, const double move[4], double factor,
                                double *fx, double *fy, double *x, double *y, double *p,
                                double force[2]) {
  (void)links, (void)tangent, (void)p;
  const int friction = pulley->law != BD_LAW_NONE;
  const vec scale = splat(factor);
  vec torque = splat(0.0), sum_x = splat(0.0), sum_y = splat(0.0);
  end_move moves[3];
  all_masses(move, moves);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      mass_linear mass = mass_linear_of(contact, pulley, i);
      if (friction) {
        load_by_masses(contact->total, i, mass.friction_by);
      }
      const mass_forces f = forces_by(&mass, moves, splat(0.0), friction);
      add_to(x, i, scale * f.x);
      add_to(y, i, scale * f.y);
      sum_x = fma_(scale, f.x, sum_x);
      sum_y = fma_(scale, f.y, sum_y);
      if (friction) {
        add_to(fx, i, scale * f.friction.x);
        add_to(fy, i, scale * f.friction.y);
        sum_x = fma_(scale, f.friction.x, sum_x);
        sum_y = fma_(scale, f.friction.y, sum_y);
        torque = fma_(scale, f.friction.torque, torque);
      }
    }
  }
  force[0] = sum(sum_x);
  force[1] = sum(sum_y);
  return sum(torque);
}

static void string_mount_row(const bd_links *links, const bd_tangent *tangent,
                             const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                             const bd_link_tangent *contact, const bd_link_scratch *scratch,
                             double g, const double a[2], double *row) {
  (void)tangent;
  const int friction = pulley->law != BD_LAW_NONE;
  const vec step = splat(g), ax = splat(g * a[0]), ay = splat(g * a[1]);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      mass_linear mass = mass_linear_of(contact, pulley, i);
      if (friction) {
        load_by_masses(contact->total, i, mass.friction_by);
      }
      for (int m = 0; m < 3; ++m) {
        for (int k = 0; k < 2; ++k) {
          const end_move move = unit_velocity(step, k);
          end_move force = normal_by(&mass, m, &move);
          if (friction) {
            const joint_force f = mass_friction_by(&mass, m, &move, splat(0.0));
            force.x += f.x;
            force.y += f.y;
          }
          store(row_part(scratch, m, k) + i, fma_(ax, force.x, ay * force.y));
        }
      }
    }
  }
  string_gather_row(&links->lay, links->link_mask, scratch, row);
}

static void string_finish_moved(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                                const bd_run *runs, const bd_link_tangent *contact, double g,
                                const double move[4], double *c) {
  double *cz = bd_field(lay, c, bd_f_state(lay, pulley->slot));
  double *cslip = bd_field(lay, c, bd_f_slip(lay, pulley->slot));
  const vec step = splat(g), none = splat(0.0);
  end_move moves[3];
  all_masses(move, moves);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      mass_linear mass = mass_linear_of(contact, pulley, i);
      const mask on = less(none, mass.friction.rho);
      const vec slide = where(on, slip_of(&mass.friction, &moves[1], 1.0));
      for (int k = i; k < i + pulley->states * pulley->stride; k += pulley->stride) {
        add_to(cz, k, where(on, state_by(contact, &mass, k, moves, slide)));
      }
      add_to(cslip, i, step * slide);
    }
  }
}
