/* SPDX-License-Identifier: MIT
 *
 * The inner loops, compiled once per instruction level: what they work on and the tables of them.
 */
#ifndef BELTDYN_KERNELS_H
#define BELTDYN_KERNELS_H

#include "base/base.h"

/* --- rate: rhs.h ----------------------------------------------------------------------------- */

/* Per-link constants, and the links' directions at the last evaluation. */
typedef struct bd_links {
  bd_layout lay;
  double half; /* l0 / 2 */
  double stiffness, damping, bending, bending_damping;
  double inv_mass, inv_inertia;
  double wind;             /* phi of link 0 seen from link n-1: 2 pi winding */
  const double *link_mask; /* 1 for links, 0 for the padding */
  double *cos, *sin;
  double *rx, *ry, *fx, *fy; /* scratch of jacobian.h */
} bd_links;

/* One pulley as the contact pass sees it. */
typedef struct bd_contact_pulley {
  double x, y, vx, vy; /* centre, relative to the origin, and its velocity */
  double radius, omega;
  double quadratic, linear, damping, hunt_crossley;
  double l0, bound;   /* of a link; of the friction state's magnitude after a step */
  int law, slot;      /* BD_LAW_..., BD_LAW_NONE: no friction; friction slot of its links */
  int states, stride; /* of friction, of a link; from one to the next in arrays of several */
  bd_friction friction;
} bd_contact_pulley;

/* The joints: means of the two ends that meet there, by the link on whose left they are,
 * (r_l + r_i) / 2 + l0 (e_l - e_i) / 4. */
typedef struct bd_points {
  double *x, *y, *vx, *vy;
} bd_points;

/* Contact integrated along the links (link_contact.h), of one pulley, by link: normal forces at its
 * two ends; what it has in contact of the halves that belong to the joints there, and the rate of
 * that. */
typedef struct bd_pressure {
  double *left, *right, *share_left, *share_right, *rate_left, *rate_right;
} bd_pressure;

/* Forces at the links' ends, and at the joints, of which both links have half. */
typedef struct bd_end_forces {
  double *left_x, *left_y, *right_x, *right_y, *joint_x, *joint_y;
} bd_end_forces;

typedef struct bd_run {
  int begin, end; /* links, multiples of BD_LANES */
} bd_run;

typedef struct bd_sums {
  double torque, contact_loss, friction_loss;
  double contact_energy; /* of press, where power is asked for */
  double force[2];       /* on the belt, of a string */
} bd_sums;

enum { BD_MAX_STAGES = 7, MAX_VECTORS = 8 };

/* Friction as the linear systems see it: none; the state times N; by slip and N alone; by one
 * state, slip and N; by several states, slip and N. */
enum {
  BD_FORM_NONE,
  BD_FORM_PLAIN,
  BD_FORM_STATELESS,
  BD_FORM_GENERAL,
  BD_FORM_SEVERAL,
  BD_N_FORMS
};

struct bd_newton_kernels;

typedef struct bd_kernels {
  const char *level;
  const struct bd_newton_kernels *newton;
  const struct bd_kernels *string; /* for belts that are strings; NULL in those */
  /* Sets the link blocks of dy: velocities, joint accelerations, zero friction rates; returns the
   * power lost in the joints' dampers. Variants [bending][ledger]. */
  double (*joints[2][2])(const bd_links *links, const double *y, double *dy);
  /* Adds the contact of the links' centres, or of a string along its bars, in the runs with one
   * pulley. Variants [law][ledger]. */
  void (*contact[BD_N_LAWS][2])(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                                const bd_run *runs, const double *y, double *dy, bd_sums *sums);
  /* Contact along the links. Directions of the links at y, into links->cos, sin, for all that
   * follows. Normal forces of one pulley [ledger]; the joints' positions and velocities, from a y
   * whose halo before link 0 is that of the last link; friction there [law][ledger], which adds its
   * sums. Forces to accelerations of the links. Squared distance of each link's nearer end. */
  void (*directions)(const bd_links *links, const double *y);
  void (*press[2])(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                   const bd_run *runs, const bd_pressure *pressure, const bd_end_forces *out,
                   const double *y, bd_sums *sums);
  void (*gather_points)(const bd_links *links, const double *co, const double *si, const double *y,
                        const bd_points *points);
  void (*rub[BD_N_LAWS][2])(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                            const bd_run *runs, const bd_points *points,
                            const bd_pressure *pressure, const bd_end_forces *out, const double *y,
                            double *dy, bd_sums *sums);
  void (*scatter_forces)(const bd_links *links, const double *co, const double *si,
                         const bd_end_forces *forces, double *dy);
  void (*nearest_ends)(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                       const bd_run *runs, const double *y, double *nearest);
  /* Of the forces at links' ends and at joints in the runs, by axes. */
  void (*sum_forces)(int n_runs, const bd_run *runs, const bd_end_forces *forces, double out[2]);
  /* After a step, the first block of BD_LANES links in [begin, end) with a contact event: a link
   * that has come to this pulley or left it, whose friction state is to be reset or is out of
   * bounds, or that is half a radius deep; `end` if none. owner: of the pulley's slot. Variants
   * [along links: by nearest_ends][friction].
   */
  int (*find_contact_event[2][2])(const bd_links *links, const bd_contact_pulley *pulley, int index,
                                  const double *owner, const double *nearest, const double *y,
                                  int begin, int end);
  /* An element of a friction law at one link; the law's bound, and the element's kinetic
   * coefficient. [law] */
  void (*law[BD_N_LAWS])(const bd_friction *friction, double l0, int element, double z, double v,
                         double normal, bd_law_point *out);
  double (*bound[BD_N_LAWS])(const bd_friction *friction);
  double (*kinetic[BD_N_LAWS])(const bd_friction *friction, int element);
  /* Largest squared speed of a link. */
  double (*fastest)(const bd_layout *lay, const double *y);
  /* out = y + h sum a[j] k[j], 1 to MAX_VECTORS vectors */
  void (*combine)(size_t n, double *out, const double *y, double h, int m, const double *a,
                  double *const *k);
  /* Largest w |h sum e[j] k[j]|, of as many, over links and pulleys, positions and velocities as
   * vectors, so that it does not depend on the axes; NaN becomes infinity. */
  double (*error_norm)(const bd_layout *lay, double h, int m, const double *e, double *const *k,
                       const double *w);
} bd_kernels;

const bd_kernels *bd_kernels_choose(void);

/* --- linear systems of the implicit methods: jacobian.h, ring.h ------------------------------ */

/* One solve: g = gamma h, the mass of a link (mass-proportional damping included). */
typedef struct bd_stage {
  double g, mass;
  double slender; /* mass of a link over what its inertia is worth at its ends */
} bd_stage;

/* Blocks of the ring's matrix, by link; k, bending and damping are the joints'. */
typedef struct bd_blocks {
  double k, bending, damping;
  const double *cos, *sin, *spin;
  double *xx, *xy, *yx, *yy, *pp;
  /* Contact along the links, where `full`: the diagonal's xp, yp, px, py; and what couples a link
   * to the one before it, and that one to it, by rows. Of a string, whose masses have x and y, the
   * first four of each are the whole coupling. */
  double *xp, *yp, *px, *py, *back[9], *forward[9];
} bd_blocks;

/* The joints as linearised, by link: direction, angular velocity, and the joints' pull along the
 * link over half its length; for one g, what turning it does to the forces at its ends. */
typedef struct bd_tangent {
  double *cos, *sin, *spin, *pull, *end_x, *end_y;
} bd_tangent;

/* The contact of one pulley as linearised: arrays by link, valid in the runs of links near the
 * pulley, 0 where nothing touches. rho: distance of the link's centre from the axis; n, t: the
 * outward normal and the tangent there; p: penetration; v_n, v_t, v_T: normal, tangential and slip
 * velocity. */
typedef struct bd_contact_tangent {
  double *nx, *ny;           /* n */
  double *rho;               /* distance from the axis */
  double *normal;            /* N */
  double *normal_over_rho;   /* N / rho */
  double *mu;                /* friction coefficient F / N */
  double *by_normal;         /* dF/dN: mu unless the law is general */
  double *by_state;          /* dF/dz: N unless the law is general */
  double *by_slip;           /* dF/dv_T, of general laws */
  double *stiff, *damp;      /* dN/dp, dN/dp' */
  double *cross;             /* dN/dp' v_t / rho */
  double *apart;             /* v_n / rho */
  double *gain, *decay;      /* dz'/dv_T, -dz'/dz */
  double *gain_normal;       /* dz'/dN, of general laws */
  double *normal_correction; /* of N at the end of a step, beyond its tangent */
  /* For one g: */
  double *xx, *xy, *yx, *yy;   /* force by position */
  double *by_given_state;      /* force by the state of friction, along -t */
  double *torque_x, *torque_y; /* torque on the pulley by position */
  double *row_x, *row_y;       /* the pulley's row of the border */
  double *slide_x, *slide_y;   /* v_T by position */
  double *state_by_slip;       /* change of z by v_T, over the step */
  double *state_by_normal;     /* and by N, of general laws */
  double *decay_factor;        /* what the step leaves of a given change of z: 1 / (1 + g decay) */
} bd_contact_tangent;

/* Contact of one pulley along the links as linearised (link_contact_tangent.h), valid in the runs.
 * By link, of its left and right end: outward normal, N, N / rho and v_t / rho; the two normal
 * forces by p_a, p_b, p_a', p_b', those of the left end first; what N will be at the end of a step
 * beyond its tangent. By joint: normal, rho, friction force F, F / rho, v_n / rho; F and the
 * state's rate by slip, state (decay: of opposite sign) and normal force; F and the rate by p_a,
 * p_b, p_a', p_b' of the link before, then of the link behind the joint. */
typedef struct bd_link_tangent {
  double *nx[2], *ny[2], *normal[2], *normal_over_rho[2], *around[2], *by[8], *correction[2];
  double *joint_nx, *joint_ny, *rho, *force, *force_over_rho, *apart;
  double *by_slip, *by_state, *by_normal, *gain, *decay, *gain_normal;
  double *direct[8], *gains[8];
  /* For one g: F and the state at the end of the step, after what the state does within it. */
  double *slip, *total[8], *given_state, *state_by_slip, *state_by[8], *decay_factor;
} bd_link_tangent;

/* Shared by all pulleys: as linearised, contact and what p_a, p_b do to the shares (left, right)
 * and to their rates; for one g, columns of the joints' forces by both links' unknowns, the forces
 * themselves, a pulley's row by both links' unknowns, what turning a link does to its moment. */
typedef struct bd_link_scratch {
  bd_pressure pressure;
  double *share_by[4], *rate_by[4];
  double *before[6], *behind[6];
  bd_end_forces forces;
  double *row_before[3], *row_behind[3];
  double *turning;
} bd_link_scratch;

/* The ring cut into arcs: row j of arc a is link base[a] + j. */
typedef struct bd_ring {
  int n_rows;
  int *base;
  double *shorter; /* 1: the arc's row 0 stands for no link */
  void *rows, *scratch, *ends;
} bd_ring;

/* Loops of solvers/newton_system.c at one instruction level. */
typedef struct bd_newton_kernels {
  int width;                  /* arcs */
  int unknowns;               /* of a link: 3, or 2 of a mass of a string */
  size_t ring_row, ring_ends; /* bytes: of a row of links, of the separators */
  /* [1 where links are coupled by full blocks: contact along links] */
  void (*factor[2])(const bd_ring *ring, const bd_blocks *blocks);
  void (*solve[2])(const bd_ring *ring, double k, double *x, double *y, double *p);
  void (*linearise_joints)(const bd_links *links, const double *y, const bd_tangent *tangent);
  void (*diagonal)(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                   const bd_blocks *blocks);
  void (*joints_product)(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                         const double *c, double *x, double *y, double *p);
  void (*finish_links)(const bd_links *links, const bd_stage *stage, int n_columns,
                       const double *columns, const double *factors, const double *x,
                       const double *y, const double *p, double *c);
  /* Variants [law]; below [BD_FORM_...]. */
  void (*linearise_contact[BD_N_LAWS])(const bd_links *links, const bd_contact_pulley *pulley,
                                       int n_runs, const bd_run *runs, const double *y,
                                       const bd_contact_tangent *contact, double h);
  double (*add_normal_correction[BD_N_FORMS])(const bd_links *links,
                                              const bd_contact_pulley *pulley, int n_runs,
                                              const bd_run *runs, const bd_contact_tangent *contact,
                                              double *c);
  double (*add_contact[BD_N_FORMS])(const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                                    const bd_contact_tangent *contact, double g,
                                    const bd_blocks *blocks, double *column_x, double *column_y);
  double (*contact_product)(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                            const bd_run *runs, const bd_contact_tangent *contact, const double *c,
                            double *x, double *y);
  void (*finish_contact[BD_N_FORMS])(const bd_layout *lay, const bd_contact_pulley *pulley,
                                     int n_runs, const bd_run *runs,
                                     const bd_contact_tangent *contact, double g,
                                     double angular_acceleration, double *c);
  double (*border_row)(int n_runs, const bd_run *runs, const bd_contact_tangent *contact,
                       const double *x, const double *y);
  /* The same of contact along the links (link_contact_jacobian.h). */
  void (*linearise_links[BD_N_LAWS])(const bd_links *links, const bd_tangent *tangent,
                                     const bd_contact_pulley *pulley, int n_runs,
                                     const bd_run *runs, const bd_points *points,
                                     const bd_link_scratch *scratch, const double *y,
                                     const bd_link_tangent *contact, double h);
  double (*add_link_correction)(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                                const bd_run *runs, const bd_link_tangent *contact,
                                const bd_end_forces *out, double *c);
  double (*add_links)(const bd_links *links, const bd_tangent *tangent,
                      const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                      const bd_link_tangent *contact, double g, const bd_blocks *blocks,
                      const bd_link_scratch *scratch, double *column_x, double *column_y,
                      double *row);
  void (*assemble)(const bd_links *links, const bd_tangent *tangent, double g,
                   const bd_link_scratch *scratch, const bd_blocks *blocks);
  void (*joints_to_links)(const bd_links *links, const bd_tangent *tangent, double *fx, double *fy,
                          double *x, double *y, double *p);
  double (*link_product)(const bd_links *links, const bd_tangent *tangent,
                         const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                         const bd_link_tangent *contact, double g, const double *c, double *fx,
                         double *fy, double *x, double *y, double *p);
  void (*add_turning)(const bd_layout *lay, const double *turning, double g, const double *c,
                      double *p);
  void (*finish_joints)(const bd_links *links, const bd_tangent *tangent,
                        const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                        const bd_link_tangent *contact, double g, double angular_acceleration,
                        double *c);
  double (*ring_product)(const bd_layout *lay, const double *const row[3], const double *x,
                         const double *y, const double *p);
  /* Pulleys whose axes move (link_mount.h). */
  double (*move_links)(const bd_links *links, const bd_tangent *tangent,
                       const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                       const bd_link_tangent *contact, const double move[4], double factor,
                       double *fx, double *fy, double *x, double *y, double *p, double force[2]);
  void (*mount_row)(const bd_links *links, const bd_tangent *tangent,
                    const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                    const bd_link_tangent *contact, const bd_link_scratch *scratch, double g,
                    const double a[2], double *row);
  void (*finish_moved)(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                       const bd_run *runs, const bd_link_tangent *contact, double g,
                       const double move[4], double *c);
  double (*sum_runs)(int n_runs, const bd_run *runs, const double *array);
} bd_newton_kernels;

extern const bd_newton_kernels bd_newton_baseline, bd_newton_string_baseline;

#endif
