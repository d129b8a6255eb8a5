/* SPDX-License-Identifier: MIT
 *
 * The tables everything else is expanded from: scene parameters with their rules, outputs, energy
 * terms, counters and errors. A row added here reaches the C structs, the checks, the NumPy arrays
 * and the Python exceptions without a second edit.
 */
#ifndef BELTDYN_FIELDS_H
#define BELTDYN_FIELDS_H

#include "friction/laws.h"

#define BD_TEXT_OF(value) #value
#define BD_TEXT(macro) BD_TEXT_OF(macro)

/* What a finite number, or each of a list, must be: X(rule, wording, least, above, most). From
 * `least` on, or above it, to `most`. */
#define BD_RULES(X)                                                                                \
  X(POSITIVE, "> 0", 0.0, 1, (double)INFINITY)                                                     \
  X(POSITIVES, "> 0", 0.0, 1, (double)INFINITY)                                                    \
  X(NONNEGATIVE, ">= 0", 0.0, 0, (double)INFINITY)                                                 \
  X(FINITE, "finite", -(double)INFINITY, 0, (double)INFINITY)                                      \
  X(LINKS, "an integer from 3 to " BD_TEXT(BD_MAX_LINKS), 3.0, 0, BD_MAX_LINKS)                    \
  X(FLAG, "0 or 1", 0.0, 0, 1.0)

/* Scene parameters: X(group, name, rule, unit, text), with a rule of BD_RULES. Groups are the
 * structs of beltdyn.h and the Python classes; those of the friction laws stand with each law. */
#define BD_BELT(X)                                                                                 \
  X(belt, length, POSITIVE, "m", "stress-free length of the closed belt, L")                       \
  X(belt, n_bodies, LINKS, "1", "number of rigid links, n_b")                                      \
  X(belt, linear_density, POSITIVE, "kg/m", "mass per unit length, rho A")                         \
  X(belt, axial_stiffness, POSITIVE, "N", "EA")                                                    \
  X(belt, axial_damping, NONNEGATIVE, "N s", "eta A")                                              \
  X(belt, bending_stiffness, NONNEGATIVE, "N m^2", "EI")                                           \
  X(belt, bending_damping, NONNEGATIVE, "N m^2 s", "eta I; 0 in the paper")
#define BD_PULLEY(X)                                                                               \
  X(pulley, radius, POSITIVE, "m", "radius on which the belt runs, r_p")                           \
  X(pulley, inertia, POSITIVE, "kg m^2", "moment of inertia about the axis, I")
#define BD_DRAG(X)                                                                                 \
  X(drag, coulomb, NONNEGATIVE, "N m", "Coulomb bearing drag, the same at any speed")              \
  X(drag, viscous, NONNEGATIVE, "N m s", "viscous bearing drag, torque over speed")                \
  X(drag, quadratic, NONNEGATIVE, "N m s^2", "quadratic bearing drag, over speed squared")
/* Mounts that move, of an axis: arms and sliders. 0 is a number chosen, of friction_stiffness, of
 * stop_stiffness, and with that of stop_damping; lowest and highest both 0: no stops. What all of
 * them have, of a force in the sense of a travel: */
#define BD_SPRUNG(X, group, unit, way, force, guide, travel)                                       \
  X(group, stiffness, NONNEGATIVE, unit "/" way, "of the spring, k")                               \
  X(group, preload, FINITE, unit, force " of the spring in the place of the scene, S_0")           \
  X(group, damping, NONNEGATIVE, unit " s/" way, "of the damper, d")                               \
  X(group, friction, NONNEGATIVE, unit, "Dahl friction of the " guide " in full sliding, F_m")     \
  X(group, friction_stiffness, NONNEGATIVE, unit "/" way,                                          \
    "of that friction before it slides, kappa")                                                    \
  X(group, lowest, FINITE, way, travel " of the lower stop from the place of the scene")           \
  X(group, highest, FINITE, way, travel " of the upper stop")                                      \
  X(group, stop_stiffness, NONNEGATIVE, unit "/" way, "of a stop, k_s")                            \
  X(group, stop_damping, NONNEGATIVE, unit " s/" way, "of a stop, d_s")
#define BD_ARM(X)                                                                                  \
  X(arm, inertia, POSITIVE, "kg m^2", "about the pivot, the pulley's mass included, J")            \
  X(arm, mass, NONNEGATIVE, "kg", "on the pulley's axis, for gravity; part of the inertia")        \
  BD_SPRUNG(X, arm, "N m", "rad", "torque", "pivot", "angle")
#define BD_SLIDER(X)                                                                               \
  X(slider, mass, POSITIVE, "kg", "of carriage and pulley")                                        \
  X(slider, weight, NONNEGATIVE, "kg", "hung on it, pulls along the direction, w")                 \
  BD_SPRUNG(X, slider, "N", "m", "force", "guide", "travel")
#define BD_PATH(X)
#define BD_SPRUNG_MOUNTS(KIND) KIND(ARM, arm) KIND(SLIDER, slider)
#define BD_MOUNTS(KIND) BD_SPRUNG_MOUNTS(KIND) KIND(PATH, path)
/* Couplings between a pulley's shaft and its rim (MODEL section 5), and the ring of a torsional
 * damper. 0 is a number chosen, of the clutch's stiffness and damping. */
#define BD_ISOLATOR(X)                                                                             \
  X(isolator, inertia, POSITIVE, "kg m^2", "of the hub and what turns with it, I_h")               \
  X(isolator, stiffness, POSITIVE, "N m/rad", "of the spring between hub and rim, k")              \
  X(isolator, damping, NONNEGATIVE, "N m s/rad", "of the damper between them, d")
#define BD_CLUTCH(X)                                                                               \
  X(clutch, inertia, POSITIVE, "kg m^2", "of the hub and what turns with it, I_h")                 \
  X(clutch, stiffness, NONNEGATIVE, "N m/rad", "of its spring, or of its rollers, k")              \
  X(clutch, damping, NONNEGATIVE, "N m s/rad", "of the damper beside it, d")                       \
  X(clutch, clockwise, FLAG, "1", "whether the rim drives the hub clockwise")
#define BD_DAMPER(X)                                                                               \
  X(damper, inertia, POSITIVE, "kg m^2", "of the free ring, I_r")                                  \
  X(damper, stiffness, NONNEGATIVE, "N m/rad", "of the spring between pulley and ring, k")         \
  X(damper, damping, NONNEGATIVE, "N m s/rad", "of the damper between them, d")
#define BD_COUPLINGS(KIND) KIND(ISOLATOR, isolator) KIND(CLUTCH, clutch) KIND(DAMPER, damper)
#define BD_CONTACT(X)                                                                              \
  X(contact, quadratic, NONNEGATIVE, "N/m^3", "c1' per metre of belt (2.8)")                       \
  X(contact, linear, NONNEGATIVE, "N/m^2", "c2' per metre of belt (2.8)")                          \
  X(contact, damping, NONNEGATIVE, "N s/m^2", "b' per metre of belt (2.8)")                        \
  X(contact, compensate, FLAG, "1", "whether the belt runs on its pulleys' radii at the preload")  \
  X(contact, hunt_crossley, NONNEGATIVE, "s/m", "d, damping in proportion to the force (2.8)")

/* All of them, the friction laws' among them; to be called with a macro of the name X. */
#define BD_LAW_PARAMETERS(name, class, general, states, text) BD_LAW_##name(X)
#define BD_KIND_PARAMETERS(KIND, name) BD_##KIND(X)
#define BD_KIND_NAME(KIND, name) #name " "
#define BD_PARAMETERS(X)                                                                           \
  BD_BELT(X)                                                                                       \
  BD_PULLEY(X)                                                                                     \
  BD_DRAG(X)                                                                                       \
  BD_MOUNTS(BD_KIND_PARAMETERS)                                                                    \
  BD_COUPLINGS(BD_KIND_PARAMETERS) BD_CONTACT(X) BD_LAWS(BD_LAW_PARAMETERS)

/* The C type of a parameter under a rule. */
#define BD_TYPE_POSITIVE double
#define BD_TYPE_POSITIVES bd_numbers
#define BD_TYPE_NONNEGATIVE double
#define BD_TYPE_FINITE double
#define BD_TYPE_LINKS int
#define BD_TYPE_FLAG int

/* Belt models: X(symbol). Each is a row of its own file in csrc/belts/; where the scene leaves it
 * open, the last that its mesh and its bending allow. */
#define BD_BELTS(X) X(joint) X(string) X(paper) X(ale)

/* Their texts and facts, for those who ask: X(type, name, text). */
#define BD_BELT_TEXTS(X)                                                                           \
  X(name, "of the row")                                                                            \
  X(text, "what its nodes are, and where they meet the pulleys")                                   \
  X(nodes, "what n_bodies counts")                                                                 \
  X(note, "on results; empty: none")
#define BD_BELT_FACTS(X)                                                                           \
  X(int, bends, "joints may resist bending")                                                       \
  X(int, mounts, "pulleys may stand on mounts")                                                    \
  X(int, tangents, "nodes lie on pulleys as tangents, longer than their arcs; else as chords")     \
  X(int, stretches, "chords stretch along themselves; else at the joints, along the circle")       \
  X(int, at_joints, "friction acts at the joints; else at the nodes")                              \
  X(int, flows, "the belt flows through cells that stand still; else nodes go with it")            \
  X(int, smooth, "contact is of lengths of belt, and sets in without a jump; else of points")      \
  X(double, shear, "m l0^2 / I_z of a link: 12 along it, 4 with its mass at the ends")             \
  X(double, reach, "of contact: so many links before and behind a node add to what acts there")    \
  X(double, least_span, "of what is told apart [links]; 0: any")                                   \
  X(double, explicit_share, "of the stability limit, that adaptive explicit steps may take")       \
  X(double, error_by_local, "estimated error over local errors")                                   \
  X(double, error_by_balance, "estimated error over what the balance of energy misses")            \
  X(double, implicit_cost, "CPU time of an implicit step over an explicit one, measured")          \
  X(double, by_rtol,                                                                               \
    "local errors of a step over the error asked, of fourth order; 0: as its method says")

/* Sizes of fields of a state and of sampled outputs: X(size, count), the count from `of`, a
 * bd_info; 0 of those that its belt lacks (bd_belt_facts). PLANE: of vectors (x, y); ENERGY:
 * columns of the ledger, which the drive alone does not decide. */
#define BD_SIZES(X)                                                                                \
  X(ONE, 1)                                                                                        \
  X(LINKS, of->n_bodies)                                                                           \
  X(JOINTS, of->n_bodies)                                                                          \
  X(CELLS, of->n_bodies)                                                                           \
  X(NODES, of->n_bodies)                                                                           \
  X(FLOW, 1)                                                                                       \
  X(MODES, of->n_modes)                                                                            \
  X(ALONG, of->n_along)                                                                            \
  X(CONTACT, of->n_bodies)                                                                         \
  X(SLOTS, (size_t)of->n_slots *(size_t)of->n_bodies)                                              \
  X(STATES, (size_t)(of->n_slots * of->n_states) * (size_t)of->n_bodies)                           \
  X(FRICTION, of->n_slots > 0 ? of->n_bodies : 0)                                                  \
  X(SLIPS, of->n_slots > 0 ? of->n_bodies : 0)                                                     \
  X(PULLEYS, of->n_pulleys)                                                                        \
  X(PLANE, of->n_pulleys)                                                                          \
  X(MOUNTS, of->n_mounts)                                                                          \
  X(COUPLINGS, of->n_couplings)                                                                    \
  X(ENERGY, 0)

/* Fields of a state, in the order of the state vector: X(symbol, name, size, scale, unit, text).
 * size: of BD_SIZES, first those of links, of which a belt has some, by its model, at last those of
 * pulleys and parts. scale: what errors are measured by (bd_state_scale): the STRETCH of a joint at
 * rest, that as a SPEED, both over a lever arm (TURN, SPIN), the FRICTION law's own, GRIP that of a
 * mount, WINDUP that of a coupling; NONE: errors are not looked at. With time they are the physical
 * state; to go on bit for bit a run needs more (bd_sim_export). */
#define BD_STATE_FIELDS(X)                                                                         \
  X(X, x, LINKS, STRETCH, "m", "mass centre of the link")                                          \
  X(Y, y, LINKS, STRETCH, "m", "mass centre of the link")                                          \
  X(PHI, phi, LINKS, TURN, "rad", "angle of the link, continuous")                                 \
  X(VX, vx, LINKS, SPEED, "m/s", "velocity of the mass centre")                                    \
  X(VY, vy, LINKS, SPEED, "m/s", "velocity of the mass centre")                                    \
  X(VPHI, vphi, LINKS, SPIN, "rad/s", "angular velocity of the link")                              \
  X(M, m, CELLS, NONE, "m", "stress-free length of belt in the cell")                              \
  X(V, v, CELLS, NONE, "m/s", "speed of the belt where the cell begins")                           \
  X(MU, mu, STATES, FRICTION, "its law's", "state of the friction law, z")                         \
  X(SLIP, slip, SLOTS, NONE, "m", "slip displacement since contact began")                         \
  X(THETA, theta, PULLEYS, TURN, "rad", "rotation angle of the pulley")                            \
  X(OMEGA, omega, PULLEYS, SPIN, "rad/s", "angular velocity of the pulley")                        \
  X(TRAVEL, travel, MOUNTS, TURN, "rad or m",                                                      \
    "travel from a mount's place, q; of a path the time")                                          \
  X(TRAVEL_SPEED, travel_speed, MOUNTS, SPIN, "rad/s or m/s", "rate of the travel")                \
  X(MOUNT_FRICTION, mount_friction, MOUNTS, GRIP, "1", "share of a mount's friction that acts")    \
  X(RIM_ANGLE, rim_angle, COUPLINGS, TURN, "rad", "angle of a coupled rim, or a damper's ring")    \
  X(RIM_SPEED, rim_speed, COUPLINGS, SPIN, "rad/s", "speed of a coupled rim, or a damper's ring")  \
  X(WINDUP, windup, COUPLINGS, WINDUP, "rad", "windup of a coupling, rim against hub, z")          \
  X(A, a, MODES, NONE, "m", "amplitudes of the spans' sine modes, span after span")                \
  X(P, p, MODES, NONE, "m/s", "amplitudes of their velocities, with those of the axes")            \
  X(ALONG, along, ALONG, NONE, "m", "amplitude of a sine wave along each span")                    \
  X(ALONG_SPEED, along_speed, ALONG, NONE, "m/s", "amplitude of its speed, with that of its ends")

/* What a model knows of itself: X(type, name, text). */
#define BD_INFO(X)                                                                                 \
  X(int, n_bodies, "links")                                                                        \
  X(int, n_pulleys, "pulleys")                                                                     \
  X(int, n_mounts, "pulleys with a mount")                                                         \
  X(int, n_couplings, "pulleys with a coupling")                                                   \
  X(int, n_slots, "friction slots per link: 1 unless spans are short; 0 without friction")         \
  X(int, n_states, "states of friction in a slot: the most that a law in use has")                 \
  X(int, n_modes, "sine modes of all spans; 0 of links")                                           \
  X(int, n_along, "waves along spans, one each; 0 of links, and of light spans")                   \
  X(int, winding, "turns of the link angle round the ring: -1 clockwise, +1 counter-clockwise")    \
  X(double, length, "stress-free length of the belt, L [m]")                                       \
  X(double, link_length, "stress-free length of a link, l0 [m]")                                   \
  X(double, link_mass, "m [kg]")                                                                   \
  X(double, link_inertia, "I_z [kg m^2]")                                                          \
  X(double, joint_stiffness, "c_tra [N/m]")                                                        \
  X(double, joint_damping, "b_tra [N s/m]")                                                        \
  X(double, bending_stiffness, "c_tor of a joint [N m]")                                           \
  X(double, bending_damping, "b_tor of a joint [N m s]")                                           \
  X(double, contact_quadratic, "c1 of a link [N/m^2]")                                             \
  X(double, contact_linear, "c2 of a link [N/m]")                                                  \
  X(double, contact_damping, "b of a link [N s/m]")                                                \
  X(double, path_length, "of the belt line round the pulleys [m]")                                 \
  X(double, strain, "path_length / length - 1")                                                    \
  X(double, strain_tension, "axial_stiffness * strain, the scale of forces [N]")                   \
  X(double, mean_tension, "of the belt at rest, in closed form: on fine links, laid freely [N]")   \
  X(double, mesh_strain, "what tangent links, longer than the arcs they span, add to the strain")  \
  X(double, contact_strain, "what its sinking into the pulleys takes off the strain at rest")      \
  X(double, spectral_bound, "bound of eigenvalues of joints, without what touches [1/s]")          \
  X(double, drag_speed, "rim speed within which Coulomb drag changes its sign, v_0 [m/s]")

/* Numbers of a mount, 0 of one that is prescribed, and of a coupling as they act, given or chosen:
 * X(name, text). */
#define BD_MOUNT_NUMBERS(X)                                                                        \
  X(inertia, "that its travel moves [kg m^2 of an angle, kg]")                                     \
  X(friction_stiffness, "of its friction before it slides [N m/rad or N/m]")                       \
  X(stop_stiffness, "of a stop [N m/rad or N/m]")                                                  \
  X(stop_damping, "of a stop [N m s/rad or N s/m]")
#define BD_COUPLING_NUMBERS(X)                                                                     \
  X(stiffness, "of its spring or rollers [N m/rad]")                                               \
  X(damping, "of the damper beside it [N m s/rad]")

/* Sampled outputs, one row a sample: X(name, group, size, unit, text). size: as of BD_SIZES. Of
 * mounts: torques of an arm, forces of a slider, in the sense of its travel. */
#define BD_OUTPUTS(X)                                                                              \
  X(theta, pulleys, PULLEYS, "rad", "rotation angle, counter-clockwise")                           \
  X(omega, pulleys, PULLEYS, "rad/s", "angular velocity")                                          \
  X(torque, pulleys, PULLEYS, "N m", "set torque M_d; or what a prescribed motion needs")          \
  X(load, pulleys, PLANE, "N", "force of the belt on the pulley, its contact and friction")        \
  X(x, belt, NODES, "m", "mass centre; of a cell where it begins")                                 \
  X(y, belt, NODES, "m", "mass centre; of a cell where it begins")                                 \
  X(phi, belt, LINKS, "rad", "link angle, continuous")                                             \
  X(vx, belt, NODES, "m/s", "velocity of the mass centre, of belt where a cell begins")            \
  X(vy, belt, NODES, "m/s", "velocity of the mass centre, of belt where a cell begins")            \
  X(vphi, belt, LINKS, "rad/s", "angular velocity of the link")                                    \
  X(flow, belt, FLOW, "m/s", "stress-free belt that leaves pulley 0, along its numbering")         \
  X(deflection, spans, MODES, "m", "amplitudes of sine modes, outwards")                           \
  X(deformation, joints, JOINTS, "m", "stretch of the joint on the left of the link, along it")    \
  X(force, joints, JOINTS, "N", "force in that joint, along it, tension positive")                 \
  X(normal, contact, CONTACT, "N", "normal force on the link, N")                                  \
  X(friction, contact, FRICTION, "N", "friction force; on the link it acts along -t")              \
  X(mu, contact, FRICTION, "1", "friction coefficient, friction force over N")                     \
  X(slip, contact, SLIPS, "m", "slip displacement since contact began")                            \
  X(velocity, contact, CONTACT, "m/s", "relative velocity v_T")                                    \
  X(travel, mounts, MOUNTS, "rad or m", "travel from its place in the scene; of a path the time")  \
  X(travel_speed, mounts, MOUNTS, "rad/s or m/s", "rate of the travel")                            \
  X(spring_force, mounts, MOUNTS, "N m or N", "force of the spring, preload and weight included")  \
  X(damper_force, mounts, MOUNTS, "N m or N", "force of the damper")                               \
  X(friction_force, mounts, MOUNTS, "N m or N", "force of friction in pivot or guide")             \
  X(stop_force, mounts, MOUNTS, "N m or N", "force of the stops")                                  \
  X(belt_force, mounts, MOUNTS, "N m or N", "force of the belt on the pulley")                     \
  X(rim_angle, couplings, COUPLINGS, "rad", "angle of the rim, or of a damper's ring")             \
  X(rim_speed, couplings, COUPLINGS, "rad/s", "angular velocity of the rim or ring")               \
  X(windup, couplings, COUPLINGS, "rad", "windup ahead of the hub, as a clutch drives")            \
  X(transmitted, couplings, COUPLINGS, "N m", "torque of the coupling on the shaft")               \
  X(energy, energy, ENERGY, "J", "the ledger, columns of BD_ENERGY_TERMS")

/* The energy ledger, MODEL section 7: X(name, kind, text). kind: STORED, a part of E; SUPPLIED and
 * LOST, works since the start, integrals in the tail of the state vector (W_name), the first of
 * them what the set torques put in; CHECK, the residual. What follows the residual is of effects
 * that not every drive has, and has a column only in drives that have them
 * (bd_model_energy_terms). */
#define BD_ENERGY_TERMS(X)                                                                         \
  X(kinetic, STORED, "kinetic energy of links and pulleys")                                        \
  X(axial, STORED, "stored in the joints' stretch")                                                \
  X(bending, STORED, "stored in bending; of an ALE belt but for a constant")                       \
  X(contact, STORED, "stored in the contact")                                                      \
  X(gravity, STORED, "potential energy")                                                           \
  X(drive, SUPPLIED, "work done by the set torques since the start")                               \
  X(joint_loss, LOST, "lost in the joint dampers since the start")                                 \
  X(contact_loss, LOST, "lost in the contact dampers since the start")                             \
  X(friction_loss, LOST, "work of friction against slip since the start")                          \
  X(residual, CHECK, "E(t) - E(0) - (drive - losses): 0 but for integration error")                \
  X(drag_loss, LOST, "lost to bearing drag since the start")                                       \
  X(mount, STORED, "stored in springs and stops of mounts, less the work of their preload")        \
  X(mount_loss, LOST, "lost in dampers, friction and stops of mounts since the start")             \
  X(path_work, LOST, "work of the belt on axes that follow a path since the start")                \
  X(coupling, STORED, "stored in springs between shafts and rims")                                 \
  X(coupling_loss, LOST, "lost in the dampers beside them since the start")

/* What is expanded for the rows that are works, and for no others. */
#define BD_WORK_STORED(...)
#define BD_WORK_SUPPLIED(...) __VA_ARGS__
#define BD_WORK_LOST(...) __VA_ARGS__
#define BD_WORK_CHECK(...)

/* Counters of a run: X(type, name, text). Errors that were not estimated are 0. */
#define BD_STATS(X)                                                                                \
  X(long, steps, "accepted steps")                                                                 \
  X(long, rejected, "rejected steps")                                                              \
  X(long, nfev, "evaluations of the right-hand side")                                              \
  X(long, njev, "evaluations of the Jacobian; explicit methods need none")                         \
  X(long, nlu, "factorisations; explicit methods need none")                                       \
  X(long, fallbacks, "steps in which only the linearly implicit Euler method succeeded")           \
  X(long, changes, "changes of method, by \"auto\"")                                               \
  X(long, searches, "rebuilds of the list of links that can touch a pulley")                       \
  X(double, smallest_step, "smallest accepted step [s]")                                           \
  X(double, largest_step, "largest accepted step [s]")                                             \
  X(double, spectral_bound, "bound of the eigenvalues of joints that touch nothing [1/s]")         \
  X(double, local_error, "largest local error of a step, in the units of rtol")                    \
  X(double, balance, "largest residual of the energy balance, over the energy transmitted")        \
  X(double, growth, "rate at which a small difference was seen to grow [1/s]; 0: none was")        \
  X(long, twin_steps, "steps made once more from a displaced state, to measure this growth")       \
  X(double, error, "estimated root mean square error of the joint forces, over the mean tension")  \
  X(double, invariant, "largest violation of an invariant, over its bound; above 1 ends the run")  \
  X(double, residual, "settling only: largest unbalanced force over the mean tension")

/* What a run may be warned of: X(code, accuracy, text). accuracy: the results may be further from
 * the truth than was asked. */
#define BD_WARNINGS(X)                                                                             \
  X(balance, 1, "the balance of energy does not close")                                            \
  X(stretch, 0, "joints stretched further than belts are")                                         \
  X(no_contact, 1, "no link touches a pulley")                                                     \
  X(growth, 1, "small differences grow exponentially")                                             \
  X(chatter, 1, "links chatter on the pulleys")                                                    \
  X(undamped, 1, "vibrations of the belt live for long, and so do errors")                         \
  X(torque, 1, "the torque function changes faster than steps follow")                             \
  X(rough_torque, 1, "the torque function jumps all the time")                                     \
  X(fallback, 1, "steps that only the first order could make erred by more than was asked")        \
  X(fixed_step, 1, "the fixed step is too long")                                                   \
  X(torque_ignored, 0, "a torque is set on a pulley whose motion is prescribed")                   \
  X(beyond_table, 0, "a pulley turns faster than the table of its torque reaches")

/* Errors: X(symbol, kind, text). Kinds: VALUE (a bad argument), MEMORY, USE (called wrongly),
 * CALL (a callback asked to stop), RUN (a run that cannot go on). */
#define BD_ERRORS(X)                                                                               \
  X(BD_ERR_MEMORY, MEMORY, "out of memory")                                                        \
  X(BD_ERR_PARAMETER, VALUE, "a parameter breaks its rule")                                        \
  X(BD_ERR_GEOMETRY, VALUE, "the belt cannot run on these pulleys")                                \
  X(BD_ERR_STATE, VALUE, "the state is not finite or not of this model")                           \
  X(BD_ERR_OPTION, VALUE, "an option breaks its rule")                                             \
  X(BD_ERR_TORQUE_DATA, VALUE, "the torque or motion data break their rule")                       \
  X(BD_ERR_BUSY, USE, "the simulation is running in another call")                                 \
  X(BD_ERR_CALLBACK, CALL, "a torque or motion function asked to stop")                            \
  X(BD_ERR_TORQUE_VALUE, RUN, "a torque or motion function gave a number that is not finite")      \
  X(BD_ERR_STEP_FLOOR, RUN, "even the shortest possible step does not meet the tolerance")         \
  X(BD_ERR_NOT_FINITE, RUN, "no step gives finite numbers")                                        \
  X(BD_ERR_PASSED_THROUGH, RUN, "a link passed through a pulley")                                  \
  X(BD_ERR_OFF_PULLEY, RUN, "the belt has come off a pulley, or settled without touching it")      \
  X(BD_ERR_JOINT_GAP, RUN, "a joint is open by more than a link's length")                         \
  X(BD_ERR_BALANCE, RUN, "more energy has appeared than half of what was transmitted")             \
  X(BD_ERR_STALLED, RUN, "the steps are too short to reach the end; not with max_steps")           \
  X(BD_ERR_FIXED_STEP, RUN, "the error of a fixed step is many times a joint's stretch")           \
  X(BD_ERR_MAX_STEPS, RUN, "the limit max_steps was reached")                                      \
  X(BD_ERR_INVARIANT, RUN, "the final state is impossible for a drive: please report it")          \
  X(BD_ERR_NOT_SETTLED, RUN, "settling only: the belt did not come to rest, or came off")

#endif
