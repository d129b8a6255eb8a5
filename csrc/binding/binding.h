/* SPDX-License-Identifier: MIT
 *
 * What the parts of the extension module share: objects, the state record, errors, torque terms.
 *
 *   module.c      the module: tables, functions, errors
 *   build.c       dicts, tuples and lists, item by item
 *   scene.c       the parts of a scene from the arguments of Model; the belt line
 *   model.c       Model, and states in and out
 *   output.c      the arrays a run fills
 *   torque.c      torque terms and motions, and calling Python from the core
 *   simulation.c  Simulation, made and run
 *   inspect.c     what it shows between its steps
 */
#ifndef BELTDYN_CORE_H
#define BELTDYN_CORE_H

#include "binding/convert.h"

#include "beltdyn.h"

typedef struct {
  PyTypeObject *model_type;
  PyTypeObject *simulation_type;
} bd_core_module;

/* Each makes its type and keeps it in the module's state. -1 with an exception. */
int bd_core_add_model(PyObject *module, bd_core_module *state);
int bd_core_add_simulation(PyObject *module, bd_core_module *state);

/* Raises what a negative code of the core stands for (the kind of its row in BD_ERRORS). Returns
 * NULL always. Of kind CALL the pending exception is left as it is. */
PyObject *bd_core_raise(int code, const bd_error *err);
/* What a function of the core has made, whose reference is taken; of a negative code that. */
PyObject *bd_core_result(PyObject *result, int code, const bd_error *err);
PyObject *bd_core_belt_line(PyObject *module, PyObject *args, PyObject *keywords);

/* The row of a method that takes keywords. */
#define BD_CORE_KEYWORDS(name, function, doc)                                                      \
  { name, (PyCFunction)(void (*)(void))(function), METH_VARARGS | METH_KEYWORDS, doc }

/* --- building -------------------------------------------------------------------------------- */

/* Each takes the reference of value, which is NULL where an exception is set already. */

/* dict[name] = value. -1 with an exception. */
int bd_core_set(PyObject *dict, const char *name, PyObject *value);
/* The list with value at its end; NULL with an exception, the list having been freed, and for NULL.
 */
PyObject *bd_core_append(PyObject *list, PyObject *value);
/* A tuple in the place of a list, which is freed; NULL for NULL. */
PyObject *bd_core_tuple(PyObject *list);

/* A C number or text of a struct in fields.h as the Python object of its kind. */
#define BD_CORE_VALUE(value)                                                                       \
  _Generic((value), int                                                                            \
           : PyLong_FromLong, long                                                                 \
           : PyLong_FromLong, double                                                               \
           : PyFloat_FromDouble, const char *                                                      \
           : PyUnicode_FromString)(value)

/* dict[name] = the member of that name of a struct in fields.h: for a row of its table. Does
 * nothing where dict is NULL; frees it and makes it NULL if that fails. */
#define BD_CORE_SET_VALUE(dict, record, name)                                                      \
  if ((dict) && bd_core_set(dict, #name, BD_CORE_VALUE((record).name)) < 0) {                      \
    Py_CLEAR(dict);                                                                                \
  }

/* --- model.c ---------------------------------------------------------------------------------- */

extern const char *const bd_core_meshes[], *const bd_core_belt_models[]; /* names of bd_belt's */

/* --- scene ----------------------------------------------------------------------------------- */

/* A tuple of the parameters of one group, in their order, into its C struct; called `label` in
 * messages, as the core calls it. */
int bd_core_read_group(PyObject *object, const char *group, const char *label, void *record);
/* A friction law, (name, tuple of its parameters); None: law 0. `label`: its name in messages. */
int bd_core_read_friction(PyObject *object, const char *label, bd_friction *friction);
/* A mount, (kind, place, numbers); arrays that it points to stay in the list `keep`. */
int bd_core_read_mount(PyObject *entry, const char *label, bd_mount *mount, PyObject *keep);
PyObject *bd_core_mount_directions(PyObject *module, PyObject *args);
/* What pulleys may have of their own, an entry each, or None: in bd_pulley's words. */
typedef struct {
  PyObject *drag, *friction, *outside, *names, *mounts, *couplings;
} bd_core_pulley_parts;
/* The pulleys as a fresh block (PyMem_Free it), after them what they point to, friction laws and
 * names, but for arrays, which stay in the list `keep`; their number in *n. */
bd_pulley *bd_core_read_pulleys(PyObject *centers, PyObject *radii, PyObject *inertias,
                                const bd_core_pulley_parts *parts, PyObject *keep, int *n);

/* --- model ----------------------------------------------------------------------------------- */

typedef struct {
  PyObject_HEAD bd_model *model; /* constant: shared by simulations, in any thread */
  bd_info info;
} bd_core_model;

/* --- states ---------------------------------------------------------------------------------- */

/* A state whose arrays a new dict holds, by the names of its fields; NULL with an exception. From a
 * mapping with "t" and every field, checked: the arrays may be the caller's own, but the core
 * copies them before the GIL is released. Fresh arrays for the core to write to. */
PyObject *bd_core_state_read(bd_state *out, PyObject *mapping, const bd_info *info);
PyObject *bd_core_state_new(bd_state *out, const bd_info *info);
/* "t" and the fields of a dict, whose reference is taken; NULL for NULL. */
PyObject *bd_core_state_timed(PyObject *fields, const bd_state *state);

/* --- outputs --------------------------------------------------------------------------------- */

/* Fresh arrays of so many rows, of energy so many columns, 0: none: owned by the list `keep`, views
 * of them by name in `dict`, their data in *output for the core. names: a set of those to make;
 * NULL: all but span_tension. */
int bd_core_output_new(bd_output *output, PyObject *keep, PyObject *dict, const bd_info *info,
                       int n_energy, npy_intp rows, PyObject *names);
/* A new set of names of outputs, from a sequence of str; NULL with an exception. */
PyObject *bd_core_output_names(PyObject *names);
PyObject *bd_core_span_tension(PyObject *module, PyObject *args, PyObject *keywords);

/* --- torque ---------------------------------------------------------------------------------- */

/* One Python callable among torque terms and motions; the core gets its address as `user`. */
typedef struct {
  PyObject *callable;
  bd_label pulley;              /* of a motion, in messages */
  PyArrayObject *theta, *omega; /* given to the callable, and again if it has kept neither */
  npy_intp n_pulleys;
  char name[BD_NAME_SIZE];  /* of the function, in messages */
  const volatile int *stop; /* the simulation's flag: looked at before each call */
} bd_core_call;

typedef struct {
  bd_torque torque;
  bd_torque_term *terms;
  bd_motion *motions;
  PyObject *arrays; /* list: owners of what these point to, until the core has copied it */
  bd_core_call *calls;
  Py_ssize_t n_calls;
} bd_core_torque;

/* From a sequence of terms, an array of breakpoints and a sequence of motions (NULL: none),
 * checked, and the flag by which the simulation is stopped. Release it in either case; set `calls`
 * NULL first where a simulation has taken them over. */
int bd_core_torque_read(bd_core_torque *out, PyObject *terms, PyObject *breakpoints,
                        PyObject *motions, const bd_model *model, const volatile int *stop);
/* -1 with KeyboardInterrupt if the flag is set. */
int bd_core_check_stop(const volatile int *stop);
void bd_core_torque_release(bd_core_torque *torque);
void bd_core_calls_free(bd_core_call *calls, Py_ssize_t n);

#endif
