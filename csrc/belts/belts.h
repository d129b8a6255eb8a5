/* SPDX-License-Identifier: MIT
 *
 * What the rows of the table of belt models share.
 */
#ifndef BELTDYN_BELTS_H
#define BELTDYN_BELTS_H

#include "belts/ale.h"
#include "physics/physics.h"

#define X(symbol) extern const bd_belt_model bd_belt_##symbol;
BD_BELTS(X)
#undef X

/* Fields of nodes that are point masses; of links, which turn as well. */
#define BD_OF_MASSES (1u << F_X | 1u << F_Y | 1u << F_VX | 1u << F_VY | 1u << F_MU | 1u << F_SLIP)
#define BD_OF_LINKS (BD_OF_MASSES | 1u << F_PHI | 1u << F_VPHI)
/* What these lack. */
#define BD_OF_CELLS (1u << BD_SIZE_CELLS | 1u << BD_SIZE_MODES | 1u << BD_SIZE_FLOW)

/* The line's point and direction `nodes` of n from its beginning. */
void bd_line_point(const bd_model *model, const bd_route *line, const double *radius, double nodes,
                   double shift, double *x, double *y, double *phi);
/* From the place of node i to that of the next on the circles of contact, which stand for the arcs
 * of the line: both ends, and the direction between them, by phi, that of the line. */
typedef struct bd_chord {
  double x0, y0, x1, y1;
} bd_chord;

bd_chord bd_line_chord(const bd_model *model, const bd_route *line, double shift, int i,
                       double *phi);
/* By kernels that have all of contact in one pass. */
void bd_contact_in_one_pass(bd_plan *plan, int j, double *y, double *dy, bd_sums *sums);

/* --- nodes.c: nodes that are masses ------------------------------------------------------------
 */

double bd_nodes_joints(bd_plan *plan, double *y, double *dy);
void bd_nodes_fall(const bd_plan *plan, double *dy);
void bd_nodes_energy(const bd_plan *plan, const double *y, const bd_joint *joints,
                     double terms[BD_N_ENERGY]);
int bd_nodes_turns(const bd_plan *plan, const double *y, int j);

/* --- touches.c: contact at nodes ---------------------------------------------------------------
 */

double bd_nodes_push(const bd_plan *plan, const double *y, int j, double force[2]);
void bd_nodes_contact_outputs(bd_plan *plan, const double *y, const bd_output *out, size_t k);
bd_contact_rounding bd_nodes_rounding(const bd_plan *plan, const double *y, int j);
double bd_nodes_off_line(bd_plan *plan, const double *y, const double *y_new, double h);

extern const bd_newton_belt bd_newton_nodes; /* solvers/newton_system.c */
extern const bd_newton_belt bd_newton_ale;   /* solvers/newton_ale.c */

/* What all rows with nodes that are masses share. */
#define BD_NODES                                                                                   \
  .newton = &bd_newton_nodes, .joints = bd_nodes_joints, .fall = bd_nodes_fall,                    \
  .list = bd_search_ready, .begin = bd_plan_assign_contacts, .after_step = bd_contact_after_step,  \
  .push = bd_nodes_push, .contact_outputs = bd_nodes_contact_outputs,                              \
  .rounding = bd_nodes_rounding, .off_line = bd_nodes_off_line, .energy = bd_nodes_energy,         \
  .turns = bd_nodes_turns

/* --- links.c: rigid links -------------------------------------------------------------------- */

void bd_links_joints_at(const bd_plan *plan, const double *y, const double *co, const double *si,
                        bd_joint *out);
void bd_links_direction(const bd_layout *lay, const double *y, int i, double e[2]);
double bd_links_stretch_difference(const bd_plan *plan, const double *y, const bd_plan *other,
                                   const double *v);
void bd_links_set_going(const bd_plan *plan, double *y, double speed);

/* What rows of rigid links share. */
#define BD_FACTS_OF_LINKS                                                                          \
  .model = BD_BELT_LINKS, .nodes = "links", .fields = BD_OF_LINKS, .lacks = BD_OF_CELLS,           \
  .bends = 1, .explicit_share = 0.93
#define BD_LINKS                                                                                   \
  BD_NODES,                                                                                        \
      .joints_text = {"joints: axial spring-dampers", "joints: axial and bending spring-dampers"}, \
      .joints_at = bd_links_joints_at, .direction = bd_links_direction,                            \
      .stretch_difference = bd_links_stretch_difference, .set_going = bd_links_set_going

/* --- along.c: contact along the links, or bars ------------------------------------------------ */

/* Scratch, for rates and for their derivatives. */
void bd_carve_pressure(bd_carver *carver, const bd_layout *lay, bd_pressure *pressure,
                       bd_end_forces *forces);
void bd_along_carve(bd_carver *carver, bd_plan *plan, const bd_model *model);
void bd_along_distances(const bd_plan *plan, const double *y, int j, int begin, int end,
                        double *out);
void bd_along_clear(const bd_plan *plan); /* the forces */
/* All of contact_at but where friction acts. */
void bd_along_contact_at(const bd_plan *plan, const double *y, int j, bd_touch *out,
                         double force[2], double *energy);
int bd_along_contact_energy(const bd_plan *plan, const double *y, int j, double *energy);

/* What rows with such contact share; masses are at the ends. */
#define BD_FACTS_ALONG                                                                             \
  .mesh = BD_MESH_JOINT, .note = "", .mounts = 1, .smooth = 1, .shear = 4.0, .reach = 1.0,         \
  .least_span = 2.5, .error_by_local = 2.0, .error_by_balance = 0.1, .implicit_cost = 5.0
#define BD_ALONG                                                                                   \
  .carve = bd_along_carve, .distances = bd_along_distances,                                        \
  .contact_energy = bd_along_contact_energy

#endif
