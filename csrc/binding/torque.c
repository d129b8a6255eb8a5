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

#include <string.h>

/* --- what a callable returned ---------------------------------------------------------------- */

#define MUST_RETURN "torque_fn must return %zd torque%s, one per pulley"
#define PLURAL(n) ((n) == 1 ? "" : "s")

static int wrong_count(npy_intp n, Py_ssize_t got) {
  PyErr_Format(PyExc_ValueError, MUST_RETURN ", got %zd", (Py_ssize_t)n, PLURAL(n), got);
  return -1;
}

static int wrong_kind(npy_intp n, PyObject *result) {
  PyErr_Format(PyExc_TypeError, MUST_RETURN ", got %.100s", (Py_ssize_t)n, PLURAL(n),
               Py_TYPE(result)->tp_name);
  return -1;
}

/* One item that is no float; it may run Python code, so the caller's sequence may change. */
static int read_item(PyObject *item, npy_intp n, npy_intp j, double *out) {
  char name[BD_NAME_SIZE * 2];
  PyOS_snprintf(name, sizeof name, MUST_RETURN ": number %zd", (Py_ssize_t)n, PLURAL(n),
                (Py_ssize_t)j);
  Py_INCREF(item);
  int failed = bd_convert_real(item, name, out);
  Py_DECREF(item);
  return failed;
}

static int read_sequence(PyObject *result, npy_intp n, double *torque) {
  for (npy_intp j = 0; j < n; j++) {
    if (PySequence_Fast_GET_SIZE(result) != n) {
      return wrong_count(n, PySequence_Fast_GET_SIZE(result));
    }
    PyObject *item = PySequence_Fast_GET_ITEM(result, j);
    if (PyFloat_CheckExact(item)) {
      torque[j] = PyFloat_AS_DOUBLE(item);
    } else if (read_item(item, n, j, &torque[j]) < 0) {
      return -1;
    }
  }
  return 0;
}

static int read_array(PyObject *result, npy_intp n, double *torque) {
  PyArrayObject *given = (PyArrayObject *)PyArray_FROM_O(result);
  if (!given) {
    return -1;
  }
  int failed = -1;
  const int masked = bd_convert_is_masked((PyObject *)given);
  if (masked) {
    if (masked > 0) {
      PyErr_Format(PyExc_ValueError, MUST_RETURN ", got masked values", (Py_ssize_t)n, PLURAL(n));
    }
  } else if (PyArray_NDIM(given) == 0) {
    wrong_kind(n, result);
  } else if (!bd_convert_is_real(given)) {
    PyErr_Format(PyExc_TypeError, MUST_RETURN ", got an array of dtype %S", (Py_ssize_t)n,
                 PLURAL(n), (PyObject *)PyArray_DESCR(given));
  } else if (PyArray_NDIM(given) != 1) {
    char shape[BD_SHAPE_SIZE];
    bd_convert_shape_text(shape, PyArray_NDIM(given), PyArray_DIMS(given));
    PyErr_Format(PyExc_ValueError, MUST_RETURN ", got an array of shape %s", (Py_ssize_t)n,
                 PLURAL(n), shape);
  } else if (PyArray_DIM(given, 0) != n) {
    wrong_count(n, PyArray_DIM(given, 0));
  } else {
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

static int read_torques(PyObject *result, npy_intp n, double *torque) {
  if (PyList_Check(result) || PyTuple_Check(result)) {
    return read_sequence(result, n, torque);
  }
  if (PyArray_CheckExact(result) && is_plain((PyArrayObject *)result, n)) {
    memcpy(torque, PyArray_DATA((PyArrayObject *)result), (size_t)n * sizeof *torque);
    return 0;
  }
  return read_array(result, n, torque);
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
    failed = read_torques(result, n, torque);
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
    char name[BD_NAME_SIZE];
    PyOS_snprintf(name, sizeof name, "what the motion of %s returns", call->pulley.text);
    failed = bd_convert_real(result, name, value);
  }
  Py_DECREF(result);
  return failed;
}

/* --- terms ----------------------------------------------------------------------------------- */

/* Converts an array and keeps it until the core has copied it. */
static const double *keep_array(bd_core_torque *out, PyObject *object, const char *name, int ndim,
                                const npy_intp *shape, npy_intp *n_rows) {
  PyArrayObject *array = bd_convert_array(object, name, ndim, shape);
  if (!array) {
    return NULL;
  }
  int failed = PyList_Append(out->arrays, (PyObject *)array);
  const double *data = PyArray_DATA(array);
  if (n_rows) {
    *n_rows = PyArray_DIM(array, 0);
  }
  Py_DECREF(array);
  return failed ? NULL : data;
}

typedef struct {
  bd_core_torque *out;
  bd_torque_term *term;
  PyObject *tuple;
  Py_ssize_t index; /* of the term, for messages */
  npy_intp n_pulleys;
} reader;

static int read_piecewise(const reader *in) {
  char name[BD_NAME_SIZE];
  npy_intp n_t = BD_ANY;
  PyOS_snprintf(name, sizeof name, "torque[%zd] times", in->index);
  in->term->t = keep_array(in->out, PyTuple_GET_ITEM(in->tuple, 1), name, 1, &n_t, &n_t);
  if (!in->term->t) {
    return -1;
  }
  const npy_intp shape[2] = {n_t, in->n_pulleys};
  PyOS_snprintf(name, sizeof name, "torque[%zd] values", in->index);
  in->term->values = keep_array(in->out, PyTuple_GET_ITEM(in->tuple, 2), name, 2, shape, NULL);
  in->term->n_t = (size_t)n_t;
  return in->term->values ? 0 : -1;
}

static int read_viscous(const reader *in) {
  char name[BD_NAME_SIZE];
  PyOS_snprintf(name, sizeof name, "torque[%zd] coefficients", in->index);
  in->term->coefficients =
      keep_array(in->out, PyTuple_GET_ITEM(in->tuple, 1), name, 1, &in->n_pulleys, NULL);
  return in->term->coefficients ? 0 : -1;
}

/* The pulley of a term or motion; of one out of range the core says so. */
static int read_pulley(PyObject *object, const char *name, int *out) {
  long pulley;
  if (bd_convert_long(object, name, &pulley) < 0) {
    return -1;
  }
  *out = pulley >= 0 && pulley < BD_MAX_PULLEYS ? (int)pulley : -1;
  return 0;
}

static int term_pulley(const reader *in, Py_ssize_t at, const char *what, int *out) {
  char name[BD_NAME_SIZE];
  PyOS_snprintf(name, sizeof name, "torque[%zd] %s", in->index, what);
  return read_pulley(PyTuple_GET_ITEM(in->tuple, at), name, out);
}

/* One of the arrays (n,) of a term; n BD_ANY: as long as it is. */
static const double *term_array(const reader *in, PyObject *object, const char *what, npy_intp *n) {
  char name[BD_NAME_SIZE];
  PyOS_snprintf(name, sizeof name, "torque[%zd] %s", in->index, what);
  return keep_array(in->out, object, name, 1, n, n);
}

/* None, or (times, factors). */
static int read_factor(const reader *in, Py_ssize_t at) {
  PyObject *factor = PyTuple_GET_ITEM(in->tuple, at);
  npy_intp n_t = BD_ANY;
  if (factor == Py_None) {
    return 0;
  }
  if (!PyTuple_Check(factor) || PyTuple_GET_SIZE(factor) != 2) {
    PyErr_Format(PyExc_TypeError, "torque[%zd] factor must be None or (times, factors), got %R",
                 in->index, factor);
    return -1;
  }
  in->term->t = term_array(in, PyTuple_GET_ITEM(factor, 0), "times", &n_t);
  in->term->values =
      in->term->t ? term_array(in, PyTuple_GET_ITEM(factor, 1), "factors", &n_t) : NULL;
  in->term->n_t = (size_t)n_t;
  return in->term->values ? 0 : -1;
}

static int read_load(const reader *in) {
  PyObject *against = PyTuple_GET_ITEM(in->tuple, 2);
  const npy_intp n = 3;
  char name[BD_NAME_SIZE];
  PyOS_snprintf(name, sizeof name, "torque[%zd] coefficients", in->index);
  const double *values = keep_array(in->out, against, name, 1, &n, NULL);
  if (!values) {
    return -1;
  }
  in->term->against = (bd_drag){values[0], values[1], values[2]};
  return term_pulley(in, 1, "pulley", &in->term->pulley) < 0 ? -1 : read_factor(in, 3);
}

static int read_table(const reader *in) {
  npy_intp n = BD_ANY;
  in->term->omega = term_array(in, PyTuple_GET_ITEM(in->tuple, 2), "speeds", &n);
  in->term->torque =
      in->term->omega ? term_array(in, PyTuple_GET_ITEM(in->tuple, 3), "torques", &n) : NULL;
  in->term->n_points = (size_t)n;
  return !in->term->torque || term_pulley(in, 1, "pulley", &in->term->pulley) < 0
             ? -1
             : read_factor(in, 4);
}

/* Orders, amplitudes and phases, from the place `at` of a tuple on; `whose`: for messages. */
static int read_harmonics(bd_core_torque *out, PyObject *tuple, Py_ssize_t at, const char *whose,
                          bd_harmonics *harmonics) {
  static const char *const names[] = {"orders", "amplitudes", "phases"};
  const double *arrays[3];
  npy_intp n = BD_ANY;
  for (int k = 0; k < 3; k++) {
    char name[BD_NAME_SIZE];
    PyOS_snprintf(name, sizeof name, "%.40s %s", whose, names[k]);
    arrays[k] = keep_array(out, PyTuple_GET_ITEM(tuple, at + k), name, 1, &n, &n);
    if (!arrays[k]) {
      return -1;
    }
  }
  *harmonics = (bd_harmonics){(size_t)n, arrays[0], arrays[1], arrays[2]};
  return 0;
}

static int read_harmonic_torque(const reader *in) {
  char whose[BD_NAME_SIZE];
  PyOS_snprintf(whose, sizeof whose, "torque[%zd]", in->index);
  return term_pulley(in, 1, "pulley", &in->term->pulley) < 0 ||
                 term_pulley(in, 2, "of", &in->term->of) < 0 ||
                 read_harmonics(in->out, in->tuple, 3, whose, &in->term->harmonics) < 0
             ? -1
             : read_factor(in, 6);
}

static int read_function(const reader *in) {
  char name[BD_NAME_SIZE];
  uintptr_t function, user;
  PyOS_snprintf(name, sizeof name, "torque[%zd] function address", in->index);
  if (bd_convert_address(PyTuple_GET_ITEM(in->tuple, 1), name, &function) < 0) {
    return -1;
  }
  if (!function) {
    PyErr_Format(PyExc_ValueError, "%s must not be 0", name);
    return -1;
  }
  PyOS_snprintf(name, sizeof name, "torque[%zd] user address", in->index);
  if (bd_convert_address(PyTuple_GET_ITEM(in->tuple, 2), name, &user) < 0) {
    return -1;
  }
  in->term->function = (bd_torque_function)function;
  in->term->user = (void *)user;
  return 0;
}

static bd_core_call *keep_callable(bd_core_torque *out, PyObject *callable, const char *name) {
  if (!PyCallable_Check(callable)) {
    PyErr_Format(PyExc_TypeError, "%s must hold a callable, got %.100s", name,
                 Py_TYPE(callable)->tp_name);
    return NULL;
  }
  bd_core_call *call = &out->calls[out->n_calls++];
  call->callable = Py_NewRef(callable);
  call->stop = out->torque.stop;
  return call;
}

static int read_call(const reader *in) {
  char name[BD_NAME_SIZE];
  PyOS_snprintf(name, sizeof name, "torque[%zd]", in->index);
  bd_core_call *call = keep_callable(in->out, PyTuple_GET_ITEM(in->tuple, 1), name);
  if (!call) {
    return -1;
  }
  call->n_pulleys = in->n_pulleys;
  in->term->call = call_python;
  in->term->user = call;
  return 0;
}

static int read_term(reader *in) {
  static const struct {
    const char *name;
    int kind;
    Py_ssize_t n_arguments;
    int (*read)(const reader *);
  } kinds[] = {
      {"piecewise", BD_TORQUE_PIECEWISE, 2, read_piecewise},
      {"viscous", BD_TORQUE_VISCOUS, 1, read_viscous},
      {"function", BD_TORQUE_FUNCTION, 2, read_function},
      {"call", BD_TORQUE_CALL, 1, read_call},
      {"load", BD_TORQUE_LOAD, 3, read_load},
      {"table", BD_TORQUE_TABLE, 4, read_table},
      {"harmonics", BD_TORQUE_HARMONICS, 6, read_harmonic_torque},
      {"curve", BD_TORQUE_CURVE, 4, read_table},
  };
  if (!PyTuple_Check(in->tuple) || !PyTuple_GET_SIZE(in->tuple) ||
      !PyUnicode_Check(PyTuple_GET_ITEM(in->tuple, 0))) {
    PyErr_Format(PyExc_TypeError, "torque[%zd] must be a tuple that begins with its kind, got %R",
                 in->index, in->tuple);
    return -1;
  }
  PyObject *kind = PyTuple_GET_ITEM(in->tuple, 0);
  const Py_ssize_t got = PyTuple_GET_SIZE(in->tuple) - 1;
  for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
    if (PyUnicode_CompareWithASCIIString(kind, kinds[k].name)) {
      continue;
    }
    if (got != kinds[k].n_arguments) {
      PyErr_Format(PyExc_ValueError, "torque[%zd] of kind '%s' must have %zd argument%s, got %zd",
                   in->index, kinds[k].name, kinds[k].n_arguments, PLURAL(kinds[k].n_arguments),
                   got);
      return -1;
    }
    in->term->kind = kinds[k].kind;
    return kinds[k].read(in);
  }
  PyErr_Format(PyExc_ValueError,
               "torque[%zd] must be of kind 'piecewise', 'viscous', 'function', 'call', 'load', "
               "'table', 'harmonics' or 'curve', got %R",
               in->index, kind);
  return -1;
}

/* Mean speed (t, values), and where there are more: orders, amplitudes, phases, fade. */
static int read_mean_speed(bd_core_torque *out, PyObject *tuple, const char *name,
                           bd_motion *motion) {
  npy_intp n_t = BD_ANY;
  motion->t = keep_array(out, PyTuple_GET_ITEM(tuple, 2), name, 1, &n_t, &n_t);
  motion->values =
      motion->t ? keep_array(out, PyTuple_GET_ITEM(tuple, 3), name, 1, &n_t, NULL) : NULL;
  motion->n_t = (size_t)n_t;
  if (!motion->values || PyTuple_GET_SIZE(tuple) == 4) {
    return motion->values ? 0 : -1;
  }
  const npy_intp two = 2;
  char whose[BD_NAME_SIZE];
  PyOS_snprintf(whose, sizeof whose, "%.40s fade", name);
  const double *fade = keep_array(out, PyTuple_GET_ITEM(tuple, 7), whose, 1, &two, NULL);
  if (!fade) {
    return -1;
  }
  memcpy(motion->fade, fade, sizeof motion->fade);
  return read_harmonics(out, tuple, 4, name, &motion->harmonics);
}

/* One of the tuples in `forms`. */
static int read_motion(bd_core_torque *out, PyObject *tuple, Py_ssize_t index,
                       const bd_model *model) {
  static const struct {
    const char *name;
    int kind;
    Py_ssize_t size;
  } forms[] = {{"piecewise", BD_MOTION_PIECEWISE, 4},
               {"crank", BD_MOTION_PIECEWISE, 8},
               {"speed", BD_MOTION_SPEED, 3},
               {"angle", BD_MOTION_ANGLE, 3}};
  enum { N_FORMS = sizeof forms / sizeof forms[0] };
  bd_motion *motion = &out->motions[index];
  const Py_ssize_t got = PyTuple_Check(tuple) ? PyTuple_GET_SIZE(tuple) : 0;
  PyObject *kind = got >= 3 ? PyTuple_GET_ITEM(tuple, 1) : NULL;
  char name[BD_NAME_SIZE];
  size_t form = 0;
  while (form < N_FORMS && (!kind || !PyUnicode_Check(kind) || got != forms[form].size ||
                            PyUnicode_CompareWithASCIIString(kind, forms[form].name))) {
    ++form;
  }
  if (form == N_FORMS) {
    PyErr_Format(PyExc_ValueError,
                 "motion[%zd] must be (pulley, 'piecewise', t, values), (pulley, 'crank', t, "
                 "values, orders, amplitudes, phases, fade), (pulley, 'speed', call) or "
                 "(pulley, 'angle', call), got %R",
                 index, tuple);
    return -1;
  }
  motion->kind = forms[form].kind;
  PyOS_snprintf(name, sizeof name, "motion[%zd] pulley", index);
  if (read_pulley(PyTuple_GET_ITEM(tuple, 0), name, &motion->pulley) < 0) {
    return -1;
  }
  PyOS_snprintf(name, sizeof name, "motion[%zd]", index);
  if (motion->kind == BD_MOTION_PIECEWISE) {
    return read_mean_speed(out, tuple, name, motion);
  }
  bd_core_call *call = keep_callable(out, PyTuple_GET_ITEM(tuple, 2), name);
  if (!call) {
    return -1;
  }
  call->pulley = bd_pulley_label(model, motion->pulley);
  motion->call = call_python_motion;
  motion->user = call;
  return 0;
}

static int read_breakpoints(bd_core_torque *out, PyObject *breakpoints) {
  if (!breakpoints) {
    return 0;
  }
  npy_intp n = BD_ANY;
  out->torque.breakpoints = keep_array(out, breakpoints, "breakpoints", 1, &n, &n);
  if (!out->torque.breakpoints) {
    return -1;
  }
  out->torque.n_breakpoints = (size_t)n;
  return 0;
}

/* A tuple of our own: converting runs Python code, which could change a list under us. */
static PyObject *own_tuple(PyObject *sequence, const char *rule) {
  PyObject *items = PySequence_Tuple(sequence);
  if (!items && PyErr_ExceptionMatches(PyExc_TypeError)) {
    PyErr_Format(PyExc_TypeError, "%s, got %.100s", rule, Py_TYPE(sequence)->tp_name);
  }
  return items;
}

int bd_core_torque_read(bd_core_torque *out, PyObject *terms, PyObject *breakpoints,
                        PyObject *motions, const bd_model *model, const volatile int *stop) {
  bd_info info;
  bd_model_info(model, &info);
  *out = (bd_core_torque){.torque.stop = stop};
  int failed = -1;
  PyObject *items = own_tuple(terms, "torque must be a sequence of terms");
  PyObject *moves = !items    ? NULL
                    : motions ? own_tuple(motions, "motion must be a sequence of tuples")
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
  if (!out->arrays) {
    goto out;
  }
  if (!out->terms || !out->motions || !out->calls) {
    PyErr_NoMemory();
    goto out;
  }
  for (Py_ssize_t i = 0; i < n; i++) {
    reader in = {out, &out->terms[i], PyTuple_GET_ITEM(items, i), i, info.n_pulleys};
    if (read_term(&in) < 0) {
      goto out;
    }
  }
  out->torque.terms = out->terms;
  out->torque.n_terms = (size_t)n;
  for (Py_ssize_t i = 0; i < n_motions; i++) {
    if (read_motion(out, PyTuple_GET_ITEM(moves, i), i, model) < 0) {
      goto out;
    }
  }
  out->torque.motions = out->motions;
  out->torque.n_motions = (size_t)n_motions;
  failed = read_breakpoints(out, breakpoints);
out:
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
