/* SPDX-License-Identifier: MIT
 *
 * The Jacobian J = d(rate)/d(state) as entries of a sparse matrix, read off the passes of which the
 * solves of (1 - g J) k = g c are made (newton_system.c): there is no second derivation.
 *
 * Of a step so short that nothing of it is left, these are J's own: W = -g F_v for links without
 * mass, Q = g^2 F_q, states of friction are eliminated with no weight, and what is restored of
 * them is g times their rate. g is a power of two, which costs no digit; what the elimination
 * leaves all the same is of the size g J^2. A step so long that nothing else is left shows at what
 * rate a state decays, 1 / (1 + g decay).
 *
 * Columns of nodes are taken together where no row sees two of them; rows and columns of bodies are
 * there as they are.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

static const double SHORT = 0x1p-200, LONG = 0x1p200; /* s */
static const double NOTHING = 0x1p-100;               /* in SI units; g J^2 is far below */

/* Columns from the entry `first` of a state on: of the nodes of a colour; -1: this one alone. */
typedef struct columns {
  int first, colour;
} columns;

void bd_newton_put(bd_entries *to, int row, int column, double value) {
  if (row < 0 || fabs(value) <= NOTHING) {
    return;
  }
  if (to->values) {
    to->rows[to->n] = to->place[row];
    to->columns[to->n] = to->place[column];
    to->values[to->n] = value;
  }
  ++to->n;
}

static int entry_of(const bd_layout *lay, int field, int i) {
  return bd_block(lay, field) * lay->stride + BD_HALO + i;
}

/* Nodes of one colour are at least three apart round the ring: in groups of three or more. */
static int colour_of(int n, int i) {
  const int groups = n / 3, size = n / groups, larger = n % groups * (size + 1);
  return i < larger ? i % (size + 1) : (i - larger) % size;
}

static int count_colours(int n) {
  const int groups = n / 3;
  return n / groups + (n % groups > 0);
}

/* The column that the row of node i sees, -1: none. */
static int column_of(const columns *of, int n, int i) {
  for (int k = -1; of->colour >= 0 && k < 2; ++k) {
    const int j = (i + k + n) % n;
    if (colour_of(n, j) == of->colour) {
      return of->first + j;
    }
  }
  return of->colour >= 0 ? -1 : of->first;
}

static void clear_bodies(const bd_reading *r) {
  const bd_layout *lay = &r->plan->model->lay;
  memset(r->system->rhs, 0, (size_t)bd_count_bodies(lay) * sizeof *r->system->rhs);
}

/* 1 in these columns, 0 elsewhere. */
static void put_units(const bd_reading *r, const columns *of) {
  const bd_layout *lay = &r->plan->model->lay;
  memset(r->c, 0, lay->size * sizeof *r->c);
  clear_bodies(r);
  for (int i = 0; i < (of->colour < 0 ? 1 : lay->n); ++i) {
    if (of->colour < 0 || colour_of(lay->n, i) == of->colour) {
      r->c[of->first + i] = 1.0;
    }
  }
  bd_newton_close(lay, r->c);
}

/* Rows of the nodes' velocities: forces by unknowns of the ring, a link's third at its end. */
static void read_nodes(const bd_reading *r, const columns *of, const double *const *force,
                       double factor) {
  const bd_links *links = &r->plan->links;
  const bd_layout *lay = &links->lay;
  const double turn = links->half * links->inv_inertia;
  for (int i = 0; i < lay->n; ++i) {
    const int column = column_of(of, lay->n, i);
    for (int u = 0; column >= 0 && u < r->system->ring_kernels->unknowns; ++u) {
      bd_newton_put(r->to, entry_of(lay, F_VX + u, i), column,
                    factor * (u < 2 ? links->inv_mass : turn) * force[u][i]);
    }
  }
}

/* Rows of the states of friction and of slip, by what else is in c. */
static void read_states(const bd_reading *r, const columns *of) {
  const bd_layout *lay = &r->plan->model->lay;
  bd_newton_restore(r->system, r->plan, r->c);
  for (int field = F_MU; field < F_MU + lay->slots * (lay->states + 1); ++field) {
    for (int i = 0; i < lay->n; ++i) {
      const int row = entry_of(lay, field, i), column = column_of(of, lay->n, i);
      if (column >= 0) {
        bd_newton_put(r->to, row, column, r->c[row] / SHORT);
      }
    }
  }
}

/* Columns of places, of given states and the like, by which forces are g^2 times what they are. */
static void read_given(const bd_reading *r, const columns *of) {
  const bd_newton_system *s = r->system;
  put_units(r, of);
  bd_newton_product(r->system, r->plan, r->c);
  read_nodes(r, of, (const double *const[]){s->x, s->y, s->p}, 1.0 / (SHORT * SHORT));
}

/* Columns of the places, or of the velocities, of nodes. */
static void read_moves(const bd_reading *r, int of_rates) {
  bd_newton_system *s = r->system;
  const bd_layout *lay = &r->plan->model->lay;
  for (int k = 0; k < s->ring_kernels->unknowns; ++k) {
    const int field = (of_rates ? F_VX : F_X) + k;
    for (int colour = 0; colour < count_colours(lay->n); ++colour) {
      const columns of = {entry_of(lay, field, 0), colour};
      if (of_rates) {
        const double *unit = bd_cfield(lay, r->c, F_VX), massless[3] = {0.0, 0.0, 0.0};
        double *const force[] = {s->x, s->y, s->p};
        put_units(r, &of);
        s->kernels->blocks_product(lay, &s->blocks.w, unit, unit, massless, force);
        read_nodes(r, &of, (const double *const[]){s->x, s->y, s->p},
                   -(k == 2 ? r->plan->links.half : 1.0) / SHORT);
      } else {
        read_given(r, &of);
        clear_bodies(r);
      }
      read_states(r, &of);
    }
  }
}

/* --- bodies ----------------------------------------------------------------------------------- */

/* The row of a body's speed, -1 if that is prescribed. */
static int row_of(const bd_reading *r, int body) {
  const bd_freedom freedom = bd_freedom_of(r->plan, body);
  return freedom.prescribed ? -1 : freedom.speed;
}

/* A body's row by the nodes near pulley j. */
static void read_row(const bd_reading *r, int body, int j) {
  const bd_newton_system *s = r->system;
  const bd_layout *lay = &r->plan->model->lay;
  const bd_run *runs = s->at.runs + j * s->at.max_runs;
  const int row = row_of(r, body), d = s->ring_kernels->unknowns;
  const double per = 1.0 / (SHORT * bd_freedom_of(r->plan, body).inertia);
  for (int n = 0; n < s->at.n_runs[j]; ++n) {
    for (int k = 0; k < d; ++k) {
      const double end = k == 2 ? r->plan->links.half : 1.0;
      for (int i = runs[n].begin; i < runs[n].end && i < lay->n; ++i) {
        const int at = k * lay->stride + i;
        bd_newton_put(r->to, row, entry_of(lay, F_X + k, i), per / SHORT * s->bodies[body].q[at]);
        bd_newton_put(r->to, row, entry_of(lay, F_VX + k, i), -per * end * s->bodies[body].w[at]);
      }
    }
  }
}

/* Rows of the body on which the belt runs at pulley j, and of that with which its axis moves, by
 * states of friction. */
static void read_friction(const bd_reading *r, int body, int j) {
  const bd_newton_system *s = r->system;
  const bd_layout *lay = &r->plan->model->lay;
  const bd_contact_pulley *pulley = &s->at.contact_pulleys[j];
  const bd_run *runs = s->at.runs + j * s->at.max_runs;
  const bd_slot *slot = &s->slots[j];
  const bd_moving_axis *axis = bd_moving_axis_of(&s->at, j);
  const double per = 1.0 / (SHORT * SHORT);
  for (int n = 0; n < s->at.n_runs[j]; ++n) {
    for (int e = 0; e < pulley->states; ++e) {
      for (int i = runs[n].begin; i < runs[n].end && i < lay->n; ++i) {
        const int at = e * lay->stride + i;
        const int column = entry_of(lay, bd_f_state(lay, pulley->slot) + e, i);
        bd_newton_put(r->to, row_of(r, body), column,
                      per / bd_freedom_of(r->plan, body).inertia * slot->given_torque[at]);
        if (axis) {
          const double *a = axis->at.a, inertia = bd_freedom_of(r->plan, axis->body).inertia;
          const double force = a[0] * slot->given_x[at] + a[1] * slot->given_y[at];
          bd_newton_put(r->to, row_of(r, axis->body), column, -per / inertia * force);
        }
      }
    }
  }
}

static void read_bodies(const bd_reading *r) {
  bd_newton_system *s = r->system;
  const bd_layout *lay = &r->plan->model->lay;
  const int bodies = bd_count_bodies(lay);
  for (int j = 0; j < lay->np; ++j) {
    const int body = bd_belt_body(lay, j);
    const bd_moving_axis *axis = bd_moving_axis_of(&s->at, j);
    read_row(r, body, j);
    read_friction(r, body, j);
    if (axis) {
      read_row(r, axis->body, j);
    }
  }
  bd_newton_bodies(s, r->plan, SHORT, SHORT * s->at.mass_damping);
  for (int body = 0; body < bodies; ++body) {
    const columns of = {bd_freedom_of(r->plan, body).speed, -1};
    const double *column = bd_newton_border(s, body);
    put_units(r, &of);
    read_nodes(r, &of,
               (const double *const[]){column, column + lay->stride, column + 2 * lay->stride},
               -1.0 / SHORT);
    s->rhs[body] = 1.0;
    read_states(r, &of);
    for (int row = 0; row < bodies; ++row) {
      bd_newton_put(r->to, row_of(r, row), of.first,
                    -s->of_bodies[row * bodies + body] /
                        (SHORT * bd_freedom_of(r->plan, row).inertia));
    }
  }
}

/* Columns of what bodies have beside their speeds, and its rows. */
static void read_single(const void *reading, int first) {
  const bd_reading *r = reading;
  const bd_newton_system *s = r->system;
  const bd_layout *lay = &r->plan->model->lay;
  const columns of = {first, -1};
  read_given(r, &of);
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    bd_newton_put(r->to, row_of(r, body), first,
                  s->rhs[body] / (SHORT * SHORT * bd_freedom_of(r->plan, body).inertia));
  }
  clear_bodies(r);
  read_states(r, &of);
}

static void put_entry(const void *reading, int row, int column, double value) {
  const bd_reading *r = reading;
  bd_newton_put(r->to, row, column, value);
}

void bd_newton_put_states(const bd_reading *r, void (*column)(const void *reading, int state)) {
  const bd_plan *plan = r->plan;
  const bd_state_entries to = {put_entry, column, r};
  for (int k = 0; k < plan->n_effects; ++k) {
    if (plan->effects[k]->states) {
      plan->effects[k]->states(&r->system->at, &plan->model->lay, &to);
    }
  }
}

/* --- all ------------------------------------------------------------------------------------- */

/* At which rate states of friction decay. */
static void read_decay(const bd_reading *r) {
  const bd_newton_system *s = r->system;
  const bd_layout *lay = &r->plan->model->lay;
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &s->at.contact_pulleys[j];
    const bd_run *runs = s->at.runs + j * s->at.max_runs;
    for (int n = 0; n < s->at.n_runs[j]; ++n) {
      for (int e = 0; e < pulley->states; ++e) {
        for (int i = runs[n].begin; i < runs[n].end && i < lay->n; ++i) {
          const int z = entry_of(lay, bd_f_state(lay, pulley->slot) + e, i);
          const double left = s->slots[j].decay[e * lay->stride + i];
          bd_newton_put(r->to, z, z, (1.0 - 1.0 / left) / LONG);
        }
      }
    }
  }
}

void bd_newton_entries(bd_newton_system *system, bd_plan *plan, double *y, double *c,
                       bd_entries *to) {
  const bd_layout *lay = &plan->model->lay;
  const bd_reading r = {system, plan, to, c};
  const double mass = plan->model->info.link_mass;
  bd_newton_fill(system, plan, y, LONG, 0.0, NULL, mass);
  read_decay(&r);
  bd_newton_fill(system, plan, y, SHORT, 0.0, NULL, SHORT * system->at.mass_damping * mass);
  for (int k = 0; k < system->ring_kernels->unknowns; ++k) {
    for (int i = 0; i < lay->n; ++i) {
      bd_newton_put(to, entry_of(lay, F_X + k, i), entry_of(lay, F_VX + k, i), 1.0);
    }
  }
  read_moves(&r, 0);
  read_moves(&r, 1);
  for (int field = F_MU; field < F_MU + lay->slots * lay->states; ++field) {
    for (int colour = 0; colour < count_colours(lay->n); ++colour) {
      read_given(&r, &(columns){entry_of(lay, field, 0), colour});
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    bd_newton_put(to, lay->theta + j, lay->omega + j, 1.0);
  }
  read_bodies(&r);
  bd_newton_put_states(&r, read_single);
}
