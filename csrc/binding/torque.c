/* SPDX-License-Identifier: MIT
 *
 * Torque terms and motions as the core wants them, and the one place where the core calls Python.
 *
 * A Python torque is called some 1e6 times a run, so its two argument arrays are used again, but
 * only while nobody else holds them: a callable that keeps them keeps their values. Guarded by
 * tests/test_module_run.py (terms, what may be returned) and tests/test_lifetime.py (kept
 * arrays).
 */
#include "binding/binding.h"

#include <stddef.h>
#include <string.h>

/* --- what a callable returned ---------------------------------------------------------------- */

#define PLURAL(n) ((n) == 1 ? "" : "s")
/* It gave something else. */
#define REFUSE(kind, from, format, ...)                                                            \
  PyErr_Format(kind, "%s, got " format, rule(&(rule_text){0}, from), __VA_ARGS__)

typedef struct {
  const bd_core_call *call;
  double t;
} asked;

typedef struct {
  char text[BD_NAME_SIZE * 3];
} rule_text;

static const char *rule(rule_text *room, const asked *from) {
  const npy_intp n = from->call->n_pulleys;
  PyOS_snprintf(room->text, sizeof room->text,
                "torque_fn must return %zd torque%s, one per pulley (%s at t = %.6g s)",
                (Py_ssize_t)n, PLURAL(n), from->call->name, from->t);
  return room->text;
}

/* One item that is no float; it may run Python code, so the caller's sequence may change. */
static int read_item(PyObject *item, const asked *from, npy_intp j, double *out) {
  char name[BD_NAME_SIZE * 4];
  PyOS_snprintf(name, sizeof name, "%s: number %zd", rule(&(rule_text){0}, from), (Py_ssize_t)j);
  Py_INCREF(item);
  int failed = bd_convert_real(item, name, out);
  Py_DECREF(item);
  return failed;
}

static int read_sequence(PyObject *result, const asked *from, double *torque) {
  const npy_intp n = from->call->n_pulleys;
  for (npy_intp j = 0; j < n; j++) {
    if (PySequence_Fast_GET_SIZE(result) != n) {
      REFUSE(PyExc_ValueError, from, "%zd", PySequence_Fast_GET_SIZE(result));
      return -1;
    }
    PyObject *item = PySequence_Fast_GET_ITEM(result, j);
    if (PyFloat_CheckExact(item)) {
      torque[j] = PyFloat_AS_DOUBLE(item);
    } else if (read_item(item, from, j, &torque[j]) < 0) {
      return -1;
    }
  }
  return 0;
}

static int read_array(PyObject *result, const asked *from, double *torque) {
  const npy_intp n = from->call->n_pulleys;
  PyArrayObject *given = (PyArrayObject *)PyArray_FROM_O(result);
  if (!given) {
    return -1;
  }
  int failed = -1;
  const int masked = bd_convert_is_masked((PyObject *)given);
  if (masked > 0) {
    REFUSE(PyExc_ValueError, from, "%s", "masked values");
  } else if (masked == 0 && PyArray_NDIM(given) == 0) {
    REFUSE(PyExc_TypeError, from, "%.100s", Py_TYPE(result)->tp_name);
  } else if (masked == 0 && !bd_convert_is_real(given)) {
    REFUSE(PyExc_TypeError, from, "an array of dtype %S", (PyObject *)PyArray_DESCR(given));
  } else if (masked == 0 && PyArray_NDIM(given) != 1) {
    char shape[BD_SHAPE_SIZE];
    bd_convert_shape_text(shape, PyArray_NDIM(given), PyArray_DIMS(given));
    REFUSE(PyExc_ValueError, from, "an array of shape %s", shape);
  } else if (masked == 0 && PyArray_DIM(given, 0) != n) {
    REFUSE(PyExc_ValueError, from, "%zd", (Py_ssize_t)PyArray_DIM(given, 0));
  } else if (masked == 0) {
    PyArrayObject *array =
        (PyArrayObject *)PyArray_FROMANY((PyObject *)given, NPY_DOUBLE, 1, 1, NPY_ARRAY_IN_ARRAY);
    if (array) {
      memcpy(torque, PyArray_DATA(array), (size_t)n * sizeof *torque);
      Py_DECREF(array);
      failed = 0;
    }
  }
  Py_DECREF(given);
  return failed;
}

/* An array of n float64 that can be copied from (or to) as it lies in memory. */
static int is_plain(PyArrayObject *array, npy_intp n) {
  return PyArray_TYPE(array) == NPY_DOUBLE && PyArray_NDIM(array) == 1 &&
         PyArray_DIM(array, 0) == n && PyArray_ISCARRAY_RO(array);
}

static int read_torques(PyObject *result, const asked *from, double *torque) {
  const npy_intp n = from->call->n_pulleys;
  if (PyList_Check(result) || PyTuple_Check(result)) {
    return read_sequence(result, from, torque);
  }
  if (PyArray_CheckExact(result) && is_plain((PyArrayObject *)result, n)) {
    memcpy(torque, PyArray_DATA((PyArrayObject *)result), (size_t)n * sizeof *torque);
    return 0;
  }
  return read_array(result, from, torque);
}

/* --- calling --------------------------------------------------------------------------------- */

/* A new reference to a read-only array of these values: the last one if it is ours alone and still
 * what it was (a callable can set its shape or dtype), else a fresh one. */
static PyObject *argument(PyArrayObject **slot, npy_intp n, const double *values) {
  PyArrayObject *array = *slot;
  if (!array || Py_REFCNT(array) != 1 || !is_plain(array, n)) {
    array = (PyArrayObject *)PyArray_SimpleNew(1, &n, NPY_DOUBLE);
    if (!array) {
      return NULL;
    }
    Py_XSETREF(*slot, array);
  }
  memcpy(PyArray_DATA(array), values, (size_t)n * sizeof *values);
  PyArray_CLEARFLAGS(array, NPY_ARRAY_WRITEABLE);
  Py_INCREF(array);
  return (PyObject *)array;
}

int bd_core_check_stop(const volatile int *stop) {
  if (*stop) {
    PyErr_SetString(PyExc_KeyboardInterrupt, "the simulation was stopped by stop()");
    return -1;
  }
  return 0;
}

/* A bd_torque_call; runs with the GIL held. */
static int call_python(double t, const double *theta, const double *omega, double *torque,
                       void *user) {
  bd_core_call *call = user;
  const npy_intp n = call->n_pulleys;
  if (bd_core_check_stop(call->stop) < 0) {
    return -1;
  }
  int failed = -1;
  PyObject *result = NULL;
  /* One slot before the arguments is the callee's to use (vectorcall's offset flag). */
  PyObject *args[4] = {NULL, PyFloat_FromDouble(t), argument(&call->theta, n, theta),
                       argument(&call->omega, n, omega)};
  if (args[1] && args[2] && args[3]) {
    result =
        PyObject_Vectorcall(call->callable, args + 1, 3 | PY_VECTORCALL_ARGUMENTS_OFFSET, NULL);
  }
  for (int k = 1; k < 4; k++) {
    Py_XDECREF(args[k]);
  }
  if (result) {
    failed = read_torques(result, &(asked){call, t}, torque);
    Py_DECREF(result);
  }
  return failed;
}

/* A bd_motion_call; runs with the GIL held. */
static int call_python_motion(double t, double *value, void *user) {
  bd_core_call *call = user;
  if (bd_core_check_stop(call->stop) < 0) {
    return -1;
  }
  PyObject *time = PyFloat_FromDouble(t);
  PyObject *result = time ? PyObject_CallOneArg(call->callable, time) : NULL;
  Py_XDECREF(time);
  if (!result) {
    return -1;
  }
  int failed = 0;
  if (PyFloat_CheckExact(result)) {
    *value = PyFloat_AS_DOUBLE(result);
  } else {
    char name[BD_NAME_SIZE * 3];
    PyOS_snprintf(name, sizeof name, "what the motion of %s returns (%s at t = %.6g s)",
                  call->pulley.text, call->name, t);
    failed = bd_convert_real(result, name, value);
  }
  Py_DECREF(result);
  return failed;
}

/* --- terms and motions ----------------------------------------------------------------------- */

/* What a place of a tuple holds: an array (n,) of any length, which goes to `count`; one (n,) or
 * (n, pulleys) of that n; one (pulleys,); numbers, so many, copied; a pulley, of which the core
 * says when it is out of range; an address, of code not 0; None or (times, factors); a callable. */
enum { NOTHING, ARRAY, SAME, ROWS, BY_PULLEY, NUMBERS, PULLEY, ADDRESS, CODE, FACTOR, CALL };

typedef struct {
  int holds;
  const char *name; /* in messages */
  size_t offset, count;
} item;

typedef struct {
  const char *name;
  int kind;
  item items[7];
} form;

#define TERM(member) offsetof(bd_torque_term, member)
#define MOTION(member) offsetof(bd_motion, member)
#define OF_PULLEY                                                                                  \
  { PULLEY, "pulley", TERM(pulley), 0 }
#define TIMES_FACTOR                                                                               \
  { FACTOR, "factor", 0, 0 }
#define SPEEDS                                                                                     \
  { ARRAY, "speeds", TERM(omega), TERM(n_points) }
#define TORQUES                                                                                    \
  { SAME, "torques", TERM(torque), 0 }
static const form term_forms[] = {
    {"piecewise",
     BD_TORQUE_PIECEWISE,
     {{ARRAY, "times", TERM(t), TERM(n_t)}, {ROWS, "values", TERM(values), 0}}},
    {"viscous", BD_TORQUE_VISCOUS, {{BY_PULLEY, "coefficients", TERM(coefficients), 0}}},
    {"function",
     BD_TORQUE_FUNCTION,
     {{CODE, "function address", TERM(function), 0}, {ADDRESS, "user address", TERM(user), 0}}},
    {"call", BD_TORQUE_CALL, {{CALL, "", 0, 0}}},
    {"load",
     BD_TORQUE_LOAD,
     {OF_PULLEY, {NUMBERS, "coefficients", TERM(against), 3}, TIMES_FACTOR}},
    {"table", BD_TORQUE_TABLE, {OF_PULLEY, SPEEDS, TORQUES, TIMES_FACTOR}},
    {"harmonics",
     BD_TORQUE_HARMONICS,
     {OF_PULLEY,
      {PULLEY, "of", TERM(of), 0},
      {ARRAY, "orders", TERM(harmonics.orders), TERM(harmonics.n)},
      {SAME, "amplitudes", TERM(harmonics.amplitudes), 0},
      {SAME, "phases", TERM(harmonics.phases), 0},
      TIMES_FACTOR}},
    {"curve", BD_TORQUE_CURVE, {OF_PULLEY, SPEEDS, TORQUES, TIMES_FACTOR}},
};
/* Behind the pulley and the kind. */
static const form motion_forms[] = {
    {"piecewise",
     BD_MOTION_PIECEWISE,
     {{ARRAY, "", MOTION(t), MOTION(n_t)}, {SAME, "", MOTION(values), 0}}},
    {"crank",
     BD_MOTION_PIECEWISE,
     {{ARRAY, "", MOTION(t), MOTION(n_t)},
      {SAME, "", MOTION(values), 0},
      {ARRAY, "orders", MOTION(harmonics.orders), MOTION(harmonics.n)},
      {SAME, "amplitudes", MOTION(harmonics.amplitudes), 0},
      {SAME, "phases", MOTION(harmonics.phases), 0},
      {NUMBERS, "fade", MOTION(fade), 2}}},
    {"speed", BD_MOTION_SPEED, {{CALL, "", 0, 0}}},
    {"angle", BD_MOTION_ANGLE, {{CALL, "", 0, 0}}},
};
#define N_FORMS(forms) (sizeof(forms) / sizeof(forms)[0])

/* The form of this name; NULL: there is none. */
static const form *find_form(const form *forms, size_t n, PyObject *name) {
  size_t k = 0;
  while (k < n && PyUnicode_CompareWithASCIIString(name, forms[k].name)) {
    ++k;
  }
  return k < n ? &forms[k] : NULL;
}

static Py_ssize_t size_of(const form *shape) {
  Py_ssize_t n = 0;
  while (n < (Py_ssize_t)N_FORMS(shape->items) && shape->items[n].holds != NOTHING) {
    ++n;
  }
  return n;
}

typedef struct {
  bd_core_torque *out;
  Py_ssize_t index; /* of the term or motion, for messages */
  const bd_model *model;
  npy_intp n_pulleys, n; /* n: of the last ARRAY */
  bd_torque_term *term;  /* what is read, or */
  bd_motion *motion;
} reader;

/* Converts an array and keeps it until the core has copied it. */
static int read_array_into(reader *in, void *record, PyObject *object, const char *name,
                           const item *row) {
  const int holds = row->holds;
  const npy_intp dims[2] = {holds == ARRAY       ? BD_ANY
                            : holds == BY_PULLEY ? in->n_pulleys
                            : holds == NUMBERS   ? (npy_intp)row->count
                                                 : in->n,
                            in->n_pulleys};
  PyArrayObject *array = bd_convert_array(object, name, holds == ROWS ? 2 : 1, dims);
  if (!array) {
    return -1;
  }
  const int failed = PyList_Append(in->out->arrays, (PyObject *)array);
  const double *data = PyArray_DATA(array);
  char *to = (char *)record + row->offset;
  if (holds == NUMBERS) {
    memcpy(to, data, row->count * sizeof *data);
  } else {
    memcpy(to, &data, sizeof data);
  }
  if (holds == ARRAY) {
    in->n = PyArray_DIM(array, 0);
    memcpy((char *)record + row->count, &(size_t){(size_t)in->n}, sizeof(size_t));
  }
  Py_DECREF(array);
  return failed;
}

/* What messages call a function: by its own name, an object of a class by that of the class. */
static void name_function(PyObject *callable, char name[BD_NAME_SIZE]) {
  PyObject *own = PyObject_GetAttrString(callable, "__name__");
  const char *text = own && PyUnicode_Check(own) ? PyUnicode_AsUTF8(own) : NULL;
  PyErr_Clear();
  PyOS_snprintf(name, BD_NAME_SIZE, "%.40s", text ? text : Py_TYPE(callable)->tp_name);
  Py_XDECREF(own);
}

static int read_call(const reader *in, PyObject *callable, const char *name) {
  if (!PyCallable_Check(callable)) {
    PyErr_Format(PyExc_TypeError, "%s must hold a callable, got %.100s", name,
                 Py_TYPE(callable)->tp_name);
    return -1;
  }
  bd_core_call *call = &in->out->calls[in->out->n_calls++];
  call->callable = Py_NewRef(callable);
  call->stop = in->out->torque.stop;
  call->n_pulleys = in->n_pulleys;
  name_function(callable, call->name);
  if (in->motion) {
    call->pulley = bd_pulley_label(in->model, in->motion->pulley);
    in->motion->call = call_python_motion;
    in->motion->user = call;
  } else {
    in->term->call = call_python;
    in->term->user = call;
  }
  return 0;
}

static int read_place(reader *in, PyObject *object, const item *row) {
  static const item factor[] = {{ARRAY, "times", TERM(t), TERM(n_t)},
                                {SAME, "factors", TERM(values), 0}};
  char name[BD_NAME_SIZE], *record = in->motion ? (char *)in->motion : (char *)in->term;
  long pulley;
  uintptr_t address;
  PyOS_snprintf(name, sizeof name, "%s[%zd]%s%s", in->motion ? "motion" : "torque", in->index,
                row->name[0] ? " " : "", row->name);
  switch (row->holds) {
  case PULLEY:
    if (bd_convert_long(object, name, &pulley) < 0) {
      return -1;
    }
    pulley = pulley >= 0 && pulley < BD_MAX_PULLEYS ? pulley : -1;
    memcpy(record + row->offset, &(int){(int)pulley}, sizeof(int));
    return 0;
  case ADDRESS:
  case CODE:
    if (bd_convert_address(object, name, &address) < 0) {
      return -1;
    }
    if (!address && row->holds == CODE) {
      PyErr_Format(PyExc_ValueError, "%s must not be 0", name);
      return -1;
    }
    memcpy(record + row->offset, &address, sizeof address);
    return 0;
  case CALL:
    return read_call(in, object, name);
  case FACTOR:
    if (object == Py_None) {
      return 0;
    }
    if (!PyTuple_Check(object) || PyTuple_GET_SIZE(object) != 2) {
      PyErr_Format(PyExc_TypeError, "%s must be None or (times, factors), got %R", name, object);
      return -1;
    }
    return read_place(in, PyTuple_GET_ITEM(object, 0), &factor[0]) < 0
               ? -1
               : read_place(in, PyTuple_GET_ITEM(object, 1), &factor[1]);
  default:
    return read_array_into(in, record, object, name, row);
  }
}

/* The places of a tuple from `begin` on. */
static int read_form(reader *in, PyObject *tuple, Py_ssize_t begin, const form *shape) {
  int failed = 0;
  for (Py_ssize_t k = 0; !failed && k < size_of(shape); k++) {
    failed = read_place(in, PyTuple_GET_ITEM(tuple, begin + k), &shape->items[k]);
  }
  return failed;
}

static int read_term(reader *in, PyObject *tuple) {
  if (!PyTuple_Check(tuple) || !PyTuple_GET_SIZE(tuple) ||
      !PyUnicode_Check(PyTuple_GET_ITEM(tuple, 0))) {
    PyErr_Format(PyExc_TypeError, "torque[%zd] must be a tuple that begins with its kind, got %R",
                 in->index, tuple);
    return -1;
  }
  PyObject *kind = PyTuple_GET_ITEM(tuple, 0);
  const form *shape = find_form(term_forms, N_FORMS(term_forms), kind);
  const Py_ssize_t got = PyTuple_GET_SIZE(tuple) - 1;
  if (!shape) {
    PyErr_Format(PyExc_ValueError,
                 "torque[%zd] must be of kind 'piecewise', 'viscous', 'function', 'call', 'load', "
                 "'table', 'harmonics' or 'curve', got %R",
                 in->index, kind);
    return -1;
  }
  if (got != size_of(shape)) {
    PyErr_Format(PyExc_ValueError, "torque[%zd] of kind '%s' must have %zd argument%s, got %zd",
                 in->index, shape->name, size_of(shape), PLURAL(size_of(shape)), got);
    return -1;
  }
  in->term->kind = shape->kind;
  return read_form(in, tuple, 1, shape);
}

static int read_motion(reader *in, PyObject *tuple) {
  static const item pulley = {PULLEY, "pulley", MOTION(pulley), 0};
  const Py_ssize_t got = PyTuple_Check(tuple) ? PyTuple_GET_SIZE(tuple) : 0;
  PyObject *kind = got >= 3 ? PyTuple_GET_ITEM(tuple, 1) : NULL;
  const form *shape =
      kind && PyUnicode_Check(kind) ? find_form(motion_forms, N_FORMS(motion_forms), kind) : NULL;
  if (!shape || got != 2 + size_of(shape)) {
    PyErr_Format(PyExc_ValueError,
                 "motion[%zd] must be (pulley, 'piecewise', t, values), (pulley, 'crank', t, "
                 "values, orders, amplitudes, phases, fade), (pulley, 'speed', call) or "
                 "(pulley, 'angle', call), got %R",
                 in->index, tuple);
    return -1;
  }
  in->motion->kind = shape->kind;
  return read_place(in, PyTuple_GET_ITEM(tuple, 0), &pulley) < 0 ? -1
                                                                 : read_form(in, tuple, 2, shape);
}

/* A tuple of our own: converting runs Python code, which could change a list under us. */
static PyObject *own_tuple(PyObject *sequence, const char *name, const char *rule) {
  PyObject *items = PySequence_Tuple(sequence);
  if (!items && PyErr_ExceptionMatches(PyExc_TypeError)) {
    bd_convert_refuse(sequence, name, rule);
  }
  return items;
}

int bd_core_torque_read(bd_core_torque *out, PyObject *terms, PyObject *breakpoints,
                        PyObject *motions, const bd_model *model, const volatile int *stop) {
  bd_info info;
  bd_model_info(model, &info);
  *out = (bd_core_torque){.torque.stop = stop};
  PyObject *items = own_tuple(terms, "torque", "a sequence of terms");
  PyObject *moves = !items    ? NULL
                    : motions ? own_tuple(motions, "motion", "a sequence of tuples")
                              : PyTuple_New(0);
  if (!moves) {
    Py_XDECREF(items);
    return -1;
  }
  const Py_ssize_t n = PyTuple_GET_SIZE(items), n_motions = PyTuple_GET_SIZE(moves);
  out->arrays = PyList_New(0);
  out->terms = PyMem_Calloc((size_t)n, sizeof *out->terms);
  out->motions = PyMem_Calloc((size_t)n_motions, sizeof *out->motions);
  out->calls = PyMem_Calloc((size_t)(n + n_motions), sizeof *out->calls);
  if (!out->terms || !out->motions || !out->calls) {
    PyErr_NoMemory();
  }
  int failed = PyErr_Occurred() ? -1 : 0;
  for (Py_ssize_t i = 0; !failed && i < n; i++) {
    reader in = {out, i, model, info.n_pulleys, 0, &out->terms[i], NULL};
    failed = read_term(&in, PyTuple_GET_ITEM(items, i));
  }
  for (Py_ssize_t i = 0; !failed && i < n_motions; i++) {
    reader in = {out, i, model, info.n_pulleys, 0, NULL, &out->motions[i]};
    failed = read_motion(&in, PyTuple_GET_ITEM(moves, i));
  }
  if (!failed && breakpoints) {
    const item times = {ARRAY, "", offsetof(bd_torque, breakpoints),
                        offsetof(bd_torque, n_breakpoints)};
    failed =
        read_array_into(&(reader){.out = out}, &out->torque, breakpoints, "breakpoints", &times);
  }
  out->torque.terms = out->terms;
  out->torque.n_terms = (size_t)n;
  out->torque.motions = out->motions;
  out->torque.n_motions = (size_t)n_motions;
  Py_DECREF(items);
  Py_DECREF(moves);
  return failed;
}

void bd_core_calls_free(bd_core_call *calls, Py_ssize_t n) {
  for (Py_ssize_t i = 0; calls && i < n; i++) {
    Py_CLEAR(calls[i].callable);
    Py_CLEAR(calls[i].theta);
    Py_CLEAR(calls[i].omega);
  }
  PyMem_Free(calls);
}

void bd_core_torque_release(bd_core_torque *torque) {
  bd_core_calls_free(torque->calls, torque->n_calls);
  PyMem_Free(torque->terms);
  PyMem_Free(torque->motions);
  Py_XDECREF(torque->arrays);
  *torque = (bd_core_torque){0};
}
