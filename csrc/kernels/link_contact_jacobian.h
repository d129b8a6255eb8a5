/* SPDX-License-Identifier: MIT
 *
 * Contact along the links in the linear systems, compiled once per instruction level, in
 * jacobian.h; names as in link_geometry.h.
 *
 * An end of a link moves by dr = d(x, y) -+ e' p and dv = d(v_x, v_y) -+ e' p_v +- w e p, upper
 * signs at the left end, p = l0/2 dphi, and there dp = -n.dr, dp' = -n.dv - (v_t / rho) t.dr. The
 * normal forces of a link depend on p, p' of its two ends, friction at a joint on those of four
 * ends, and by slip on the joint, whose move is the mean of two ends. One function says what a move
 * of a link does to its contact; columns of the matrix are its values for unit moves, products its
 * values for a given one. A force at an end acts on the link by (1, -+e')^T, which turns with it.
 */

#include "kernels/link_contact_tangent.h"

/* --- moves ----------------------------------------------------------------------------------- */

typedef struct end_move {
  vec x, y, vx, vy;
} end_move;

/* A link's two ends: 0 left, 1 right. */
typedef struct link_move {
  end_move end[2];
} link_move;

/* Of a link along (c, s), turning at w. */
INLINE link_move move_of(vec c, vec s, vec w, vec x, vec y, vec p, vec vx, vec vy, vec vp) {
  const vec px = s * p, py = c * p;
  const vec qx = fma_(w, c * p, s * vp), qy = fnma_(c, vp, w * px);
  return (link_move){{{x + px, y - py, vx + qx, vy + qy}, {x - px, y + py, vx - qx, vy - qy}}};
}

/* A unit velocity in one unknown, with the move g that comes with it. */
INLINE link_move unit_move(vec c, vec s, vec w, vec g, const int unknown) {
  const vec one = splat(1.0), none = splat(0.0);
  if (unknown == 2) {
    return move_of(c, s, w, none, none, g, none, none, one);
  }
  const end_move end =
      unknown == 0 ? (end_move){g, none, one, none} : (end_move){none, g, none, one};
  return (link_move){{end, end}};
}

/* A link's ends on a pulley: outward normals and v_t / rho. */
typedef struct link_normals {
  vec nx[2], ny[2], around[2];
} link_normals;

/* p_a, p_b, p_a', p_b' */
INLINE void pressing(const link_normals *at, const link_move *move, vec *out) {
  for (int e = 0; e < 2; ++e) {
    const end_move m = move->end[e];
    const vec nx = at->nx[e], ny = at->ny[e];
    out[e] = -fma_(nx, m.x, ny * m.y);
    out[2 + e] = -fma_(at->around[e], fnma_(ny, m.x, nx * m.y), fma_(nx, m.vx, ny * m.vy));
  }
}

INLINE vec product4(const vec *a, const vec *b) {
  return fma_(a[0], b[0], fma_(a[1], b[1], fma_(a[2], b[2], a[3] * b[3])));
}

/* A link's contact as linearised. */
typedef struct link_linear {
  link_normals at;
  vec over_rho[2], by[8];
} link_linear;

INLINE link_linear link_linear_of(const bd_link_tangent *t, int i) {
  link_linear link;
  for (int e = 0; e < 2; ++e) {
    link.at.nx[e] = load(t->nx[e] + i);
    link.at.ny[e] = load(t->ny[e] + i);
    link.at.around[e] = load(t->around[e] + i);
    link.over_rho[e] = load(t->normal_over_rho[e] + i);
  }
  for (int m = 0; m < 8; ++m) {
    link.by[m] = load(t->by[m] + i);
  }
  return link;
}

/* Normals of the link before, whose place is not aligned. */
INLINE link_normals normals_before(const bd_link_tangent *t, int i) {
  link_normals at;
  for (int e = 0; e < 2; ++e) {
    at.nx[e] = load_unaligned(t->nx[e] + i - 1);
    at.ny[e] = load_unaligned(t->ny[e] + i - 1);
    at.around[e] = load_unaligned(t->around[e] + i - 1);
  }
  return at;
}

/* On a link in its three unknowns. */
typedef struct link_force {
  vec x, y, p;
} link_force;

INLINE link_force force_of_ends(vec c, vec s, vec lx, vec ly, vec rx, vec ry) {
  return (link_force){lx + rx, ly + ry, fnma_(s, rx - lx, c * (ry - ly))};
}

/* What a move does to the normal forces of a link. */
INLINE link_force normal_forces(const link_linear *link, const link_move *move, vec c, vec s) {
  vec pressed[4], fx[2], fy[2];
  pressing(&link->at, move, pressed);
  for (int e = 0; e < 2; ++e) {
    const vec nx = link->at.nx[e], ny = link->at.ny[e];
    const vec along = link->over_rho[e] * fnma_(ny, move->end[e].x, nx * move->end[e].y);
    const vec more = product4(link->by + 4 * e, pressed);
    fx[e] = fnma_(along, ny, more * nx);
    fy[e] = fma_(along, nx, more * ny);
  }
  return force_of_ends(c, s, fx[0], fy[0], fx[1], fy[1]);
}

/* Of the ends that meet there, a joint is the mean. */
#define HALF 0.5

/* Friction at a joint as linearised, for one g. */
typedef struct joint_linear {
  vec nx, ny, rho, force, force_over_rho, apart, omega, slip;
} joint_linear;

INLINE joint_linear joint_linear_of(const bd_link_tangent *t, const bd_contact_pulley *pulley,
                                    int i) {
  return (joint_linear){.nx = load(t->joint_nx + i),
                        .ny = load(t->joint_ny + i),
                        .rho = load(t->rho + i),
                        .force = load(t->force + i),
                        .force_over_rho = load(t->force_over_rho + i),
                        .apart = load(t->apart + i),
                        .omega = splat(pulley->omega),
                        .slip = load(t->slip + i)};
}

/* Slip velocity of a joint by a move of one of its ends, of which it takes part in `share`: half,
 * but for the masses of a string. */
INLINE vec slip_of(const joint_linear *joint, const end_move *move, const double share) {
  const vec rn = fma_(joint->nx, move->x, joint->ny * move->y);
  const vec rt = fnma_(joint->ny, move->x, joint->nx * move->y);
  const vec vt = fnma_(joint->ny, move->vx, joint->nx * move->vy);
  return splat(share) * fnma_(joint->apart, rt, fnma_(joint->omega, rn, vt));
}

/* Force on the belt, and torque on the pulley. */
typedef struct joint_force {
  vec x, y, torque;
} joint_force;

/* ... by that move, which makes the friction force larger by `more`. */
INLINE joint_force friction_by(const joint_linear *joint, const end_move *move, vec more,
                               const double share) {
  const vec part = splat(share);
  const vec rn = part * fma_(joint->nx, move->x, joint->ny * move->y);
  const vec rt = part * fnma_(joint->ny, move->x, joint->nx * move->y);
  const vec along = joint->force_over_rho * rt;
  return (joint_force){.x = fma_(along, joint->nx, more * joint->ny),
                       .y = fnma_(more, joint->nx, along * joint->ny),
                       .torque = fma_(joint->rho, more, joint->force * rn)};
}

/* By unit moves of the link before the joint (right: 1) or behind it (0). */
INLINE joint_force friction_column(const joint_linear *joint, const link_normals *at,
                                   const vec *total, vec c, vec s, vec w, vec g, const int unknown,
                                   const int right) {
  const link_move move = unit_move(c, s, w, g, unknown);
  vec pressed[4];
  pressing(at, &move, pressed);
  const end_move *end = &move.end[right];
  const vec slide = slip_of(joint, end, HALF);
  return friction_by(joint, end, fma_(joint->slip, slide, product4(total, pressed)), HALF);
}

/* --- what a step does beyond the tangent ---------------------------------------------------------
 */

/* Adds to the forces of a rate what N will be beyond its tangent; returns its torque. */
static double add_link_correction(const bd_links *links, const bd_contact_pulley *pulley,
                                  int n_runs, const bd_run *runs, const bd_link_tangent *contact,
                                  const bd_end_forces *out, double *c) {
  const bd_link_tangent t = *contact;
  const int friction = pulley->law != BD_LAW_NONE;
  const int stride = links->lay.stride;
  double *cz = bd_field(&links->lay, c, bd_f_state(&links->lay, pulley->slot));
  vec torque = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const vec left = load(t.correction[0] + i), right = load(t.correction[1] + i);
      store(out->left_x + i, fma_(left, load(t.nx[0] + i), load(out->left_x + i)));
      store(out->left_y + i, fma_(left, load(t.ny[0] + i), load(out->left_y + i)));
      store(out->right_x + i, fma_(right, load(t.nx[1] + i), load(out->right_x + i)));
      store(out->right_y + i, fma_(right, load(t.ny[1] + i), load(out->right_y + i)));
      if (friction) {
        const vec more = left + load_unaligned(t.correction[1] + i - 1);
        const vec drag = load(t.by_normal + i) * more;
        store(out->joint_x + i, fma_(drag, load(t.joint_ny + i), load(out->joint_x + i)));
        store(out->joint_y + i, fnma_(drag, load(t.joint_nx + i), load(out->joint_y + i)));
        for (int k = i; k < i + pulley->states * stride; k += stride) {
          store(cz + k, fma_(load(t.gain_normal + k), more, load(cz + k)));
        }
        torque = fma_(drag, load(t.rho + i), torque);
      }
    }
  }
  return sum(torque);
}

/* --- matrix ---------------------------------------------------------------------------------- */

INLINE void add_to(double *array, int i, vec v) {
  store(array + i, load(array + i) + v);
}

/* Normal forces, into the diagonal blocks. */
INLINE void add_normals(const bd_tangent *tangent, int i, const bd_link_tangent *t, double g,
                        const bd_blocks *b, const bd_link_scratch *scratch) {
  const vec c = load(tangent->cos + i), s = load(tangent->sin + i), w = load(tangent->spin + i);
  const vec step = splat(g);
  const link_linear link = link_linear_of(t, i);
  double *const rows[3][3] = {{b->xx, b->xy, b->xp}, {b->yx, b->yy, b->yp}, {b->px, b->py, b->pp}};
  for (int k = 0; k < 3; ++k) {
    const link_move move = unit_move(c, s, w, step, k);
    const link_force f = normal_forces(&link, &move, c, s);
    add_to(rows[0][k], i, -step * f.x);
    add_to(rows[1][k], i, -step * f.y);
    add_to(rows[2][k], i, -step * f.p);
  }
  const bd_end_forces *out = &scratch->forces;
  const vec left = load(t->normal[0] + i), right = load(t->normal[1] + i);
  add_to(out->left_x, i, left * link.at.nx[0]);
  add_to(out->left_y, i, left * link.at.ny[0]);
  add_to(out->right_x, i, right * link.at.nx[1]);
  add_to(out->right_y, i, right * link.at.ny[1]);
}

/* For one g, what the states of friction do within the step is put into what slip and penetrations
 * do to the friction force: `total`. */
INLINE void eliminate_states(const bd_contact_pulley *pulley, const bd_link_tangent *t, int i,
                             vec step, vec *total) {
  vec slip = load(t->by_slip + i);
  for (int m = 0; m < 8; ++m) {
    total[m] = load(t->direct[m] + i);
  }
  for (int k = i; k < i + pulley->states * pulley->stride; k += pulley->stride) {
    const vec decay_factor = 1.0 / fma_(step, load(t->decay + k), splat(1.0));
    const vec by_state = load(t->by_state + k), change = step * decay_factor;
    const vec state_by_slip = change * load(t->gain + k);
    store(t->decay_factor + k, decay_factor);
    store(t->state_by_slip + k, state_by_slip);
    store(t->given_state + k, by_state * decay_factor);
    slip = fma_(by_state, state_by_slip, slip);
    for (int m = 0; m < 8; ++m) {
      const vec state_by = change * load(t->gains[m] + k);
      total[m] = fma_(by_state, state_by, total[m]);
      store(t->state_by[m] + k, state_by);
    }
  }
  store(t->slip + i, slip);
  for (int m = 0; m < 8; ++m) {
    store(t->total[m] + i, total[m]);
  }
}

/* What a pulley's spin does to the friction at a joint, into its column; returns what the pulley's
 * own equation gets. */
INLINE vec add_spin(const joint_linear *joint, int i, vec step, double *column_x,
                    double *column_y) {
  const vec spin_column = step * joint->slip * joint->rho;
  store(column_x + i, joint->ny * spin_column);
  store(column_y + i, -joint->nx * spin_column);
  return spin_column * joint->rho;
}

/* Friction, into the joints' columns, the border and what solves need for g; returns what the
 * pulley's own equation gets. */
INLINE vec add_friction(const bd_tangent *tangent, const bd_contact_pulley *pulley, int i,
                        const bd_link_tangent *t, double g, const bd_link_scratch *scratch,
                        double *column_x, double *column_y) {
  const vec step = splat(g);
  vec total[8];
  eliminate_states(pulley, t, i, step, total);
  const joint_linear joint = joint_linear_of(t, pulley, i);
  for (int side = 0; side < 2; ++side) { /* the link before the joint, the one behind it */
    const int at = i - 1 + side;
    const vec c = load_unaligned(tangent->cos + at), s = load_unaligned(tangent->sin + at);
    const vec w = load_unaligned(tangent->spin + at);
    const link_normals normals = side == 0 ? normals_before(t, i) : link_linear_of(t, i).at;
    double *const *columns = side == 0 ? scratch->before : scratch->behind;
    double *const *row = side == 0 ? scratch->row_before : scratch->row_behind;
    for (int k = 0; k < 3; ++k) {
      const joint_force f =
          friction_column(&joint, &normals, total + 4 * side, c, s, w, step, k, 1 - side);
      add_to(columns[2 * k], i, -step * f.x);
      add_to(columns[2 * k + 1], i, -step * f.y);
      store(row[k] + i, -step * f.torque);
    }
  }
  add_to(scratch->forces.joint_x, i, joint.force * joint.ny);
  add_to(scratch->forces.joint_y, i, -(joint.force * joint.nx));
  return add_spin(&joint, i, step, column_x, column_y);
}

/* A row by links from what stands with the joints before and behind them. */
INLINE void gather_row(const bd_layout *lay, const double *link_mask,
                       const bd_link_scratch *scratch, double *row) {
  for (int k = 0; k < 3; ++k) {
    double *before = scratch->row_before[k], *behind = scratch->row_behind[k];
    double *to = row + (size_t)k * (size_t)lay->stride;
    before[lay->n] = before[0];
    for (int i = 0; i < lay->n8; i += WIDTH) {
      const mask link = less(splat(0.0), load(link_mask + i));
      store(to + i, where(link, load(behind + i) + load_unaligned(before + i + 1)));
    }
  }
}

static double add_links(const bd_links *links, const bd_tangent *tangent,
                        const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                        const bd_link_tangent *contact, double g, const bd_blocks *blocks,
                        const bd_link_scratch *scratch, double *column_x, double *column_y,
                        double *row) {
  const bd_layout *lay = &links->lay;
  const int friction = pulley->law != BD_LAW_NONE;
  vec own = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      add_normals(tangent, i, contact, g, blocks, scratch);
      if (friction) {
        own += add_friction(tangent, pulley, i, contact, g, scratch, column_x, column_y);
      }
    }
  }
  if (friction) {
    gather_row(lay, links->link_mask, scratch, row);
  }
  return sum(own);
}

/* The blocks of the ring from the joints' columns: half of a joint's force acts on each link. */
static void assemble(const bd_links *links, const bd_tangent *tangent, double g,
                     const bd_link_scratch *scratch, const bd_blocks *blocks) {
  const bd_layout *lay = &links->lay;
  const bd_blocks *b = blocks;
  const int n = lay->n;
  const vec half = splat(0.5), geometric = splat(g * g / links->half);
  double *const rows[3][3] = {{b->xx, b->xy, b->xp}, {b->yx, b->yy, b->yp}, {b->px, b->py, b->pp}};
  for (int k = 0; k < 6; ++k) {
    scratch->before[k][n] = scratch->before[k][0];
    scratch->behind[k][n] = scratch->behind[k][0];
  }
  scratch->forces.joint_x[n] = scratch->forces.joint_x[0];
  scratch->forces.joint_y[n] = scratch->forces.joint_y[0];
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec c = load(tangent->cos + i), s = load(tangent->sin + i);
    const vec cl = load_unaligned(tangent->cos + i - 1), sl = load_unaligned(tangent->sin + i - 1);
    for (int k = 0; k < 3; ++k) {
      const double *before = scratch->before[2 * k] + i, *behind = scratch->behind[2 * k] + i;
      const double *before_y = scratch->before[2 * k + 1] + i;
      const double *behind_y = scratch->behind[2 * k + 1] + i;
      const vec bx = half * load(before), by = half * load(before_y);
      const vec hx = half * load(behind), hy = half * load(behind_y);
      const vec rx = half * load_unaligned(before + 1), ry = half * load_unaligned(before_y + 1);
      add_to(rows[0][k], i, hx + rx);
      add_to(rows[1][k], i, hy + ry);
      add_to(rows[2][k], i, fnma_(s, rx - hx, c * (ry - hy)));
      store(b->back[k] + i, bx);
      store(b->back[3 + k] + i, by);
      store(b->back[6 + k] + i, fnma_(c, by, s * bx));
      store(b->forward[k] + i, hx);
      store(b->forward[3 + k] + i, hy);
      store(b->forward[6 + k] + i, fnma_(sl, hx, cl * hy));
    }
    const both_ends f = forces_on(&scratch->forces, i);
    const vec turning = fma_(c, f.rx - f.lx, s * (f.ry - f.ly));
    store(scratch->turning + i, turning);
    add_to(b->pp, i, geometric * turning);
  }
}

/* --- solves ---------------------------------------------------------------------------------- */

/* Forces at joints, added to those of the links; the joint after the last link is the first. */
static void joints_to_links(const bd_links *links, const bd_tangent *tangent, double *fx,
                            double *fy, double *x, double *y, double *p) {
  const bd_layout *lay = &links->lay;
  const vec half = splat(0.5);
  fx[lay->n] = fx[0];
  fy[lay->n] = fy[0];
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const link_force f = force_of_ends(
        load(tangent->cos + i), load(tangent->sin + i), half * load(fx + i), half * load(fy + i),
        half * load_unaligned(fx + i + 1), half * load_unaligned(fy + i + 1));
    add_to(x, i, f.x);
    add_to(y, i, f.y);
    add_to(p, i, f.p);
  }
}

/* A link's move as c has it, with or without velocities. */
INLINE link_move move_in(const bd_links *links, const bd_tangent *tangent, const double *c, int i,
                         const int solved) {
  const bd_layout *lay = &links->lay;
  const vec half = splat(links->half), none = splat(0.0);
  const int stride = lay->stride;
  const double *q = bd_cfield(lay, c, F_X) + i, *v = bd_cfield(lay, c, F_VX) + i;
  return move_of(load_unaligned(tangent->cos + i), load_unaligned(tangent->sin + i),
                 load_unaligned(tangent->spin + i), load_unaligned(q), load_unaligned(q + stride),
                 half * load_unaligned(q + 2 * stride), solved ? load_unaligned(v) : none,
                 solved ? load_unaligned(v + stride) : none,
                 solved ? half * load_unaligned(v + 2 * stride) : none);
}

INLINE vec product_with(double *const *by, int i, const vec *pressed) {
  const vec at[4] = {load(by[0] + i), load(by[1] + i), load(by[2] + i), load(by[3] + i)};
  return product4(at, pressed);
}

/* Adds one pulley's contact to g F_q b_q and g F_z's part, b = g c, whose halo is set: on the
 * links, and at the joints; returns the pulley's own. */
static double link_product(const bd_links *links, const bd_tangent *tangent,
                           const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                           const bd_link_tangent *contact, double g, const double *c, double *fx,
                           double *fy, double *x, double *y, double *p) {
  const bd_link_tangent *t = contact;
  const int friction = pulley->law != BD_LAW_NONE;
  const double *cz = bd_cfield(&links->lay, c, bd_f_state(&links->lay, pulley->slot));
  const vec g2 = splat(g * g);
  vec torque = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const link_linear link = link_linear_of(t, i);
      const link_move here = move_in(links, tangent, c, i, 0);
      const link_force f =
          normal_forces(&link, &here, load(tangent->cos + i), load(tangent->sin + i));
      add_to(x, i, g2 * f.x);
      add_to(y, i, g2 * f.y);
      add_to(p, i, g2 * f.p);
      if (friction) {
        const joint_linear joint = joint_linear_of(t, pulley, i);
        const link_move before = move_in(links, tangent, c, i - 1, 0);
        const link_normals normals = normals_before(t, i);
        vec pressed[4], more = splat(0.0);
        for (int e = 0; e < pulley->states; ++e) {
          const int k = e * pulley->stride + i;
          const vec given = load(t->given_state + k) * load(cz + k);
          more = e == 0 ? given : more + given;
        }
        pressing(&link.at, &here, pressed);
        more += product_with(t->total + 4, i, pressed);
        pressing(&normals, &before, pressed);
        more += product_with(t->total, i, pressed);
        const vec slide =
            slip_of(&joint, &before.end[1], HALF) + slip_of(&joint, &here.end[0], HALF);
        more = fma_(joint.slip, slide, more);
        const joint_force one = friction_by(&joint, &before.end[1], more, HALF);
        const joint_force other = friction_by(&joint, &here.end[0], splat(0.0), HALF);
        add_to(fx, i, g2 * (one.x + other.x));
        add_to(fy, i, g2 * (one.y + other.y));
        torque = fma_(g2, one.torque + other.torque, torque);
      }
    }
  }
  return sum(torque);
}

/* What the links' angles do to the moments of the forces at their ends, added. */
static void add_turning(const bd_layout *lay, const double *turning, double g, const double *c,
                        double *p) {
  const double *phi = bd_cfield(lay, c, F_PHI);
  const vec g2 = splat(g * g);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    add_to(p, i, -(g2 * load(turning + i) * load(phi + i)));
  }
}

/* The friction unknowns of one pulley's joints; everything else of c is solved, its halo set. */
static void finish_joints(const bd_links *links, const bd_tangent *tangent,
                          const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                          const bd_link_tangent *contact, double g, double angular_acceleration,
                          double *c) {
  const bd_layout *lay = &links->lay;
  const bd_link_tangent *t = contact;
  double *cz = bd_field(lay, c, bd_f_state(lay, pulley->slot));
  double *cslip = bd_field(lay, c, bd_f_slip(lay, pulley->slot));
  const vec spin = splat(angular_acceleration), step = splat(g);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const joint_linear joint = joint_linear_of(t, pulley, i);
      const link_move before = move_in(links, tangent, c, i - 1, 1);
      const link_move here = move_in(links, tangent, c, i, 1);
      const mask link = less(splat(0.0), load(links->link_mask + i));
      const link_normals normals[2] = {normals_before(t, i), link_linear_of(t, i).at};
      vec pressed[2][4];
      vec slide = slip_of(&joint, &before.end[1], HALF) + slip_of(&joint, &here.end[0], HALF);
      slide = where(less(splat(0.0), joint.rho), fnma_(joint.rho, spin, slide));
      pressing(&normals[0], &before, pressed[0]);
      pressing(&normals[1], &here, pressed[1]);
      for (int k = i; k < i + pulley->states * pulley->stride; k += pulley->stride) {
        vec z = load(t->decay_factor + k) * load(cz + k);
        z = fma_(load(t->state_by_slip + k), slide, z);
        z += product_with(t->state_by, k, pressed[0]);
        z += product_with(t->state_by + 4, k, pressed[1]);
        store(cz + k, where(link, z));
      }
      store(cslip + i, where(link, fma_(step, slide, load(cslip + i))));
    }
  }
}

static double ring_product(const bd_layout *lay, const double *const row[3], const double *x,
                           const double *y, const double *p) {
  vec total = splat(0.0);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    total = fma_(load(row[0] + i), load(x + i), total);
    total = fma_(load(row[1] + i), load(y + i), total);
    total = fma_(load(row[2] + i), load(p + i), total);
  }
  return sum(total);
}
