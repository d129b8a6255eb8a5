/* SPDX-License-Identifier: MIT
 *
 * Contact along the links with a pulley whose axis moves, in the linear systems; compiled once per
 * instruction level, in jacobian.h. All that contact knows is where links are against the axis, so
 * a move of the axis is one of all links the other way.
 */

INLINE link_move all_links(const double move[4]) {
  const end_move end = {splat(move[0]), splat(move[1]), splat(move[2]), splat(move[3])};
  return (link_move){{end, end}};
}

/* Adds what a move (x, y, v_x, v_y) of all links against the axis does to the forces of one
 * pulley, times `factor`: on the links, and at the joints; their sum, into `force`; returns its
 * torque on the pulley. */
static double move_links(const bd_links *links, const bd_tangent *tangent,
                         const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                         const bd_link_tangent *contact, const double move[4], double factor,
                         double *fx, double *fy, double *x, double *y, double *p, double force[2]) {
  (void)links;
  const bd_link_tangent *t = contact;
  const int friction = pulley->law != BD_LAW_NONE;
  const link_move all = all_links(move);
  const end_move *end = &all.end[0];
  const vec scale = splat(factor);
  vec torque = splat(0.0), sum_x = splat(0.0), sum_y = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const link_linear link = link_linear_of(t, i);
      const link_force f =
          normal_forces(&link, &all, load(tangent->cos + i), load(tangent->sin + i));
      add_to(x, i, scale * f.x);
      add_to(y, i, scale * f.y);
      add_to(p, i, scale * f.p);
      sum_x = fma_(scale, f.x, sum_x);
      sum_y = fma_(scale, f.y, sum_y);
      if (friction) {
        const joint_linear joint = joint_linear_of(t, pulley, i);
        const link_normals normals = normals_before(t, i);
        vec pressed[4], more = (joint.slip + joint.slip) * slip_of(&joint, end, HALF);
        pressing(&link.at, &all, pressed);
        more += product_with(t->total + 4, i, pressed);
        pressing(&normals, &all, pressed);
        more += product_with(t->total, i, pressed);
        const joint_force one = friction_by(&joint, end, more, HALF);
        const joint_force other = friction_by(&joint, end, splat(0.0), HALF);
        const vec jx = scale * (one.x + other.x), jy = scale * (one.y + other.y);
        add_to(fx, i, jx);
        add_to(fy, i, jy);
        sum_x += jx;
        sum_y += jy;
        torque = fma_(scale, one.torque + other.torque, torque);
      }
    }
  }
  force[0] = sum(sum_x);
  force[1] = sum(sum_y);
  return sum(torque);
}

/* The row of a mount whose axis moves along a: g times what unit moves of the links do to the sum
 * of the forces of its pulley along a, by the links' three unknowns. The scratch is clear. */
static void mount_row(const bd_links *links, const bd_tangent *tangent,
                      const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                      const bd_link_tangent *contact, const bd_link_scratch *scratch, double g,
                      const double a[2], double *row) {
  const bd_layout *lay = &links->lay;
  const bd_link_tangent *t = contact;
  const int friction = pulley->law != BD_LAW_NONE;
  const vec step = splat(g), ax = splat(g * a[0]), ay = splat(g * a[1]);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const vec c = load(tangent->cos + i), s = load(tangent->sin + i), w = load(tangent->spin + i);
      const link_linear link = link_linear_of(t, i);
      for (int k = 0; k < 3; ++k) {
        const link_move move = unit_move(c, s, w, step, k);
        const link_force f = normal_forces(&link, &move, c, s);
        store(scratch->row_behind[k] + i, fma_(ax, f.x, ay * f.y));
      }
      if (!friction) {
        continue;
      }
      const joint_linear joint = joint_linear_of(t, pulley, i);
      for (int side = 0; side < 2; ++side) { /* the link before the joint, the one behind it */
        const int at = i - 1 + side;
        const link_normals normals = side == 0 ? normals_before(t, i) : link.at;
        double *const *to = side == 0 ? scratch->row_before : scratch->row_behind;
        vec total[4];
        for (int m = 0; m < 4; ++m) {
          total[m] = load(t->total[4 * side + m] + i);
        }
        for (int k = 0; k < 3; ++k) {
          const joint_force f =
              friction_column(&joint, &normals, total, load_unaligned(tangent->cos + at),
                              load_unaligned(tangent->sin + at), load_unaligned(tangent->spin + at),
                              step, k, 1 - side);
          add_to(to[k], i, fma_(ax, f.x, ay * f.y));
        }
      }
    }
  }
  gather_row(lay, links->link_mask, scratch, row);
}

/* Adds to the friction unknowns of one pulley's joints what a move of all links against its axis
 * does to them. */
static void finish_moved(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                         const bd_run *runs, const bd_link_tangent *contact, double g,
                         const double move[4], double *c) {
  const bd_link_tangent *t = contact;
  double *cz = bd_field(lay, c, bd_f_state(lay, pulley->slot));
  double *cslip = bd_field(lay, c, bd_f_slip(lay, pulley->slot));
  const link_move all = all_links(move);
  const vec step = splat(g), two = splat(2.0), none = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const joint_linear joint = joint_linear_of(t, pulley, i);
      const mask on = less(none, joint.rho);
      const link_normals normals[2] = {normals_before(t, i), link_linear_of(t, i).at};
      vec pressed[2][4];
      const vec slide = where(on, two * slip_of(&joint, &all.end[0], HALF));
      pressing(&normals[0], &all, pressed[0]);
      pressing(&normals[1], &all, pressed[1]);
      for (int k = i; k < i + pulley->states * pulley->stride; k += pulley->stride) {
        vec z = load(t->state_by_slip + k) * slide;
        z += product_with(t->state_by, k, pressed[0]);
        z += product_with(t->state_by + 4, k, pressed[1]);
        add_to(cz, k, where(on, z));
      }
      add_to(cslip, i, step * slide);
    }
  }
}

static double sum_runs(int n_runs, const bd_run *runs, const double *array) {
  vec total = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      total += load(array + i);
    }
  }
  return sum(total);
}
