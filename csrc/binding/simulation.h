/* SPDX-License-Identifier: MIT
 *
 * The Simulation object, for the two files of its methods: simulation.c makes and runs it,
 * inspect.c shows what it has come to.
 */
#ifndef BELTDYN_CORE_SIMULATION_H
#define BELTDYN_CORE_SIMULATION_H

#include "binding/binding.h"

#include <stdatomic.h>

typedef struct {
  PyObject_HEAD bd_sim *sim; /* NULL only after the garbage collector cleared a cycle */
  bd_settling *settling;     /* what owns it, if it settles; else NULL */
  bd_core_model *model;
  bd_core_call *calls; /* the core's `user` pointers point here */
  Py_ssize_t n_calls;
  PyObject *outputs; /* list of the arrays the core writes to; NULL: no sample times */
  PyObject *passes;
  volatile int stop; /* set by stop(), in any thread; looked at here and in the core */
  double rate;       /* steps per second of wall time, 0: not known yet */
  int ledger, started;
  atomic_bool busy;
} bd_core_sim;

/* Every use of `sim` is between these. enter: -1 with a RuntimeError if it is in use already, by
 * another thread or by the caller of the torque function that asks. */
int bd_core_enter(bd_core_sim *self);
void bd_core_leave(bd_core_sim *self);

/* Its methods and properties in inspect.c. */
PyObject *bd_core_sim_state(PyObject *object, PyObject *none);
PyObject *bd_core_sim_export(PyObject *object, PyObject *none);
PyObject *bd_core_sim_import(PyObject *object, PyObject *record);
PyObject *bd_core_sim_time_passes(PyObject *object, PyObject *argument);
extern PyGetSetDef bd_core_sim_properties[];

#endif
