/* SPDX-License-Identifier: MIT
 *
 * ALE belt: what it is made of.
 */
#ifndef BELTDYN_BELTS_ALE_H
#define BELTDYN_BELTS_ALE_H

#include "model/model.h"

/* Of an arc, or its pulley. */
typedef struct bd_ale_pulley {
  double center[2], radius, raised; /* p0 of a compensated contact */
  double damping;                   /* b' */
  int side, cells;
  const bd_friction *friction; /* NULL: none */
} bd_ale_pulley;

/* A drive by its data per metre of belt; its tension at rest is known. */
struct bd_ale_drive {
  int np, direction;
  double linear_density, axial_stiffness, axial_damping, bending_stiffness, bending_damping;
  double quadratic, linear; /* c1', c2' */
  double gravity[2], rest;
  int moving, along; /* axes do, or may; spans have a wave along them */
  bd_ale_pulley *pulleys;
};

/* Cells of an arc, none longer than this: an even number, 6 at least. */
int bd_ale_cells(double arc, double longest);
/* Where the slab of arc j begins; of the number of arcs, how many slots there are. */
int bd_ale_first_slot(const bd_ale_drive *drive, int j);
void bd_ale_carve(bd_carver *carver, bd_ale *ale, const bd_ale_drive *drive);
/* Fills what has been carved; dampers of spans, once axes are placed. */
void bd_ale_make(bd_ale *ale, const bd_ale_drive *drive);
void bd_ale_damp_spans(bd_ale *ale);
/* Constants of a span's waves, by its length at rest; what they are under a force that presses it,
 * X of the span known. */
void bd_ale_fit_waves(const bd_ale *ale, bd_ale_span *span);
void bd_ale_hold_waves(const bd_ale *ale, bd_ale_span *span, double pressing);
/* Arrays of a state, or of its rates, after one another: of so many numbers. */
size_t bd_ale_state_size(const bd_ale_drive *drive, int states);
bd_ale_state bd_ale_state_in(const bd_ale *ale, int states, double *block);

/* A belt that runs along itself at this flow [stress-free m/s] under one force H in all spans,
 * without friction, its pulleys with it: into y and the speeds of the arcs. Axes are placed.
 * Returns its stress-free length. */
double bd_ale_lay(bd_ale *ale, double pressing, double flow, const bd_ale_state *y);
/* The same of a given length, at a speed in its spans; H, NaN if none is found. */
double bd_ale_start(bd_ale *ale, double length, double speed, const bd_ale_state *y);

/* At the state whose rate was the last to be evaluated: what the belt stores, and the power that it
 * loses. */
typedef struct bd_ale_energy {
  double axial, contact, bending, kinetic, lateral;
} bd_ale_energy;

typedef struct bd_ale_losses {
  double axial, bending, friction;
} bd_ale_losses;

/* --- ale_ring.c, ale_jacobian.c -----------------------------------------------------------------
 */

/* Where the entries of a row stand that begins a cell's, or is a node's: of a cell's in the columns
 * of the metres of the cell before it, its own, the next one, and of both its nodes; of a node's of
 * both cells, and of the node before it, itself, the next one; of a span's those beyond both its
 * ends. Columns are `lead` apart; its number among all unknowns. */
typedef struct bd_ale_row {
  double *cells[3], *nodes[3];
  int lead, at;
} bd_ale_row;

/* The Jacobian of the belt's rates by the belt's unknowns; by pulley its column of the rim's speed,
 * the row of the torque on it, and that torque by that speed. Of axes that have a lever: the row of
 * the belt's force along it, and that force by the speeds of rims; columns of the travel's speed
 * and of the travel, torques and forces by them: (which, on what, by which). The shear of the ends
 * of a span, which friction cells deep in the arcs feels, goes by the span's unknowns: by span and
 * end this row, the columns of what follows the shear, torque and force by it. */
typedef struct bd_ale_newton {
  bd_ale_ring ring;
  bd_ale_slopes slopes;
  int states, stride;
  size_t state_size;                                /* from its first number on */
  int *cell_block, *cell_at, *node_block, *node_at; /* by slot: of m, which z follow; of v */
  double *column, *row, *own;
  double *push, *push_by_rim, *moved[2], *torque_by[2], *push_by[2];
  double (*shear_row)[BD_ALE_OF_SPAN], *shear_column, *shear_torque, *shear_push;
  bd_ale_row *cells, *nodes; /* by slot */
  bd_ale_moves *moves;
  bd_ale_answers *answers; /* by span */
} bd_ale_newton;

/* states: the most that a law has. */
void bd_ale_newton_carve(bd_carver *carver, bd_ale_newton *newton, const bd_ale_drive *drive,
                         int states);
/* At the state whose rate was the last to be evaluated. */
void bd_ale_linearise(bd_ale_newton *newton, const bd_ale *ale, const bd_ale_kernels *kernels,
                      const bd_ale_state *y, const bd_ale_state *dy);
/* The columns of these n axes, by differences of rates in turn, which are written to
 * `scratch`: of the rates that bd_ale_linearise has had. The last rate is another's afterwards. */
void bd_ale_linearise_axes(bd_ale_newton *newton, bd_ale *ale, const bd_ale_kernels *kernels,
                           const bd_ale_state *y, const bd_ale_state *dy,
                           const bd_ale_state *scratch, int n, const int *axes);
/* All of a rate, W as it is. */
void bd_ale_rate(bd_ale *ale, const bd_ale_kernels *kernels, const bd_ale_state *y,
                 const bd_ale_state *dy);
/* A state, or rates, as the unknowns of the ring, and back. */
void bd_ale_gather(const bd_ale_newton *newton, const bd_ale *ale, const bd_ale_state *y,
                   double *x);
void bd_ale_scatter(const bd_ale_newton *newton, const bd_ale *ale, const double *x,
                    const bd_ale_state *y);

/* --- ale_row.c -------------------------------------------------------------------------------- */

/* The belt of a plan: of what the last rate was evaluated. */
typedef struct bd_ale_belt {
  bd_ale ale;
  const bd_ale_kernels *kernels;
  bd_ale_state y, dy, spare;
  int *slot;                 /* of cells, as the state vector has them */
  double *carried, *inertia; /* (mounts, mounts) */
  double *forces;            /* (2, mounts), at rest */
  double *seen;              /* the state that the last rate is of, */
  int known;                 /* 1: if it still is; 2: with forces on axes that stand */
} bd_ale_belt;

/* Between state vectors and slabs. */
void bd_ale_read(const bd_plan *plan, const double *y, const bd_ale_state *slabs);
void bd_ale_write(const bd_plan *plan, const bd_ale_state *slabs, double *y);
/* The rate at y, axes where the plan has them; it is kept until another one is asked for. */
void bd_ale_evaluate(const bd_plan *plan, const double *y);
/* The same, with forces on axes that stand. */
const bd_ale *bd_ale_look(const bd_plan *plan, const double *y);
/* Axes where the plan has them, speeds of rims, laws of friction that the plan has. */
void bd_ale_put_axes(const bd_plan *plan, const double *y);
/* Inertia of the belt on mounts (mounts, mounts), at the last rate. */
void bd_ale_carried(const bd_plan *plan, double *matrix);
/* Accelerations of mounts from what moves them, by their own inertia and this of the belt. */
void bd_ale_carry(const bd_plan *plan, const double *inertia, double *q);

/* --- ale_outputs.c, functions of the row -------------------------------------------------------
 */

void bd_ale_joints_at(const bd_plan *plan, const double *y, const double *co, const double *si,
                      bd_joint *out);
double bd_ale_push(const bd_plan *plan, const double *y, int j, double force[2]);
void bd_ale_contact_outputs(bd_plan *plan, const double *y, const bd_output *out, size_t k);
void bd_ale_stored(const bd_plan *plan, const double *y, const bd_joint *unused,
                   double terms[BD_N_ENERGY]);
void bd_ale_weigh(const bd_model *model, double *weights);
double bd_ale_error(const bd_plan *plan, const bd_step_sum *of);
double bd_ale_stretch_difference(const bd_plan *plan, const double *y, const bd_plan *other,
                                 const double *v);

/* --- ale_start.c ------------------------------------------------------------------------------ */

/* A positive definite matrix (n, n), which is lost; right-hand side in, solution out. */
void bd_ale_solve_mounts(int n, double *a, double *x);
/* Functions of the row: running along itself with the same flow everywhere; at rest, or at a speed.
 */
void bd_ale_set_going(const bd_plan *plan, double *y, double speed);
int bd_ale_rest(const bd_plan *plan, double speed, double *y, bd_error *err);

bd_ale_energy bd_ale_energy_of(const bd_ale *ale, const bd_ale_state *y);
bd_ale_losses bd_ale_losses_of(const bd_ale *ale, const bd_ale_state *y);
/* Powers that the contact of arcs takes. */
void bd_ale_lose_in_contact(bd_ale *ale, const bd_ale_state *y);

#endif
