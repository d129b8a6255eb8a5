/* SPDX-License-Identifier: MIT
 *
 * Converters of arguments; what each accepts is said in convert.h. Every message begins with the
 * argument's name, states the rule and what was given. Guarded by tests/test_module.py.
 */
#include "binding/convert.h"

#include <math.h>
#include <string.h>

/* --- scalars --------------------------------------------------------------------------------- */

int bd_convert_refuse(PyObject *object, const char *name, const char *rule) {
  PyErr_Format(PyExc_TypeError, "%s must be %s, got %.100s", name, rule, Py_TYPE(object)->tp_name);
  return -1;
}

static int holds_masked(PyObject *object, int depth) {
  if (PyArray_Check(object)) {
    /* Nobody can have made a masked array before that module was imported. */
    PyObject *name = PyArray_CheckExact(object) ? NULL : PyUnicode_FromString("numpy.ma");
    PyObject *module = name ? PyImport_GetModule(name) : NULL;
    PyObject *answer = module ? PyObject_CallMethod(module, "is_masked", "O", object) : NULL;
    int masked = answer ? PyObject_IsTrue(answer) : PyErr_Occurred() ? -1 : 0;
    Py_XDECREF(name);
    Py_XDECREF(module);
    Py_XDECREF(answer);
    return masked;
  }
  if (!depth || !(PyList_Check(object) || PyTuple_Check(object))) {
    return 0;
  }
  int masked = 0;
  for (Py_ssize_t k = 0; !masked && k < PySequence_Fast_GET_SIZE(object); k++) {
    PyObject *item = Py_NewRef(PySequence_Fast_GET_ITEM(object, k));
    masked = PyFloat_CheckExact(item) ? 0 : holds_masked(item, depth - 1);
    Py_DECREF(item);
  }
  return masked;
}

int bd_convert_is_masked(PyObject *object) {
  return holds_masked(object, NPY_MAXDIMS);
}

static int refuse_masked(PyObject *object, const char *name) {
  int masked = bd_convert_is_masked(object);
  if (masked > 0) {
    PyErr_Format(PyExc_ValueError, "%s must not hold masked values", name);
  }
  return masked ? -1 : 0;
}

/* Numbers that are no Python float: by their kind first, because bool has __index__, NumPy's
 * complex scalars and arrays have __float__, and all of those would convert in silence. */
static int is_real_scalar(PyObject *object) {
  if (PyBool_Check(object) || PyArray_IsScalar(object, Bool) ||
      PyArray_IsScalar(object, ComplexFloating)) {
    return 0;
  }
  if (PyArray_Check(object)) {
    PyArrayObject *array = (PyArrayObject *)object;
    return PyArray_NDIM(array) == 0 && bd_convert_is_real(array);
  }
  if (PyLong_Check(object) || PyIndex_Check(object)) {
    return 1;
  }
  const PyNumberMethods *number = Py_TYPE(object)->tp_as_number;
  return number && number->nb_float;
}

int bd_convert_real(PyObject *object, const char *name, double *out) {
  if (PyFloat_Check(object)) {
    *out = PyFloat_AS_DOUBLE(object);
    return 0;
  }
  if (!is_real_scalar(object)) {
    return bd_convert_refuse(object, name, "a real number");
  }
  if (PyArray_Check(object) && refuse_masked(object, name) < 0) {
    return -1;
  }
  PyObject *number = PyNumber_Float(object);
  if (!number) {
    if (PyErr_ExceptionMatches(PyExc_OverflowError)) {
      PyErr_Format(PyExc_ValueError, "%s is too large for a float64", name);
    }
    return -1;
  }
  *out = PyFloat_AS_DOUBLE(number);
  Py_DECREF(number);
  return 0;
}

static const char *not_finite_text(double value) {
  return isnan(value) ? "nan" : value > 0 ? "inf" : "-inf";
}

int bd_convert_finite(PyObject *object, const char *name, double *out) {
  if (bd_convert_real(object, name, out) < 0) {
    return -1;
  }
  if (!isfinite(*out)) {
    PyErr_Format(PyExc_ValueError, "%s must be finite, got %s", name, not_finite_text(*out));
    return -1;
  }
  return 0;
}

/* A new reference to an exact int, for what may stand where an integer is asked for. */
static PyObject *as_integer(PyObject *object, const char *name) {
  if (PyBool_Check(object) || PyArray_IsScalar(object, Bool) || !PyIndex_Check(object) ||
      (PyArray_Check(object) && !PyArray_ISINTEGER((PyArrayObject *)object))) {
    bd_convert_refuse(object, name, "an integer");
    return NULL;
  }
  if (PyArray_Check(object) && refuse_masked(object, name) < 0) {
    return NULL;
  }
  return PyNumber_Index(object);
}

int bd_convert_long(PyObject *object, const char *name, long *out) {
  PyObject *integer = as_integer(object, name);
  if (!integer) {
    return -1;
  }
  int overflow = 0;
  *out = PyLong_AsLongAndOverflow(integer, &overflow);
  if (overflow) {
    PyErr_Format(PyExc_ValueError, "%s is too %s: %R", name, overflow > 0 ? "large" : "small",
                 integer);
  }
  Py_DECREF(integer);
  return PyErr_Occurred() ? -1 : 0;
}

int bd_convert_bool(PyObject *object, const char *name, int *out) {
  if (!PyBool_Check(object) && !PyArray_IsScalar(object, Bool)) {
    return bd_convert_refuse(object, name, "True or False");
  }
  *out = PyObject_IsTrue(object);
  return *out < 0 ? -1 : 0;
}

int bd_convert_address(PyObject *object, const char *name, uintptr_t *out) {
  PyObject *integer = as_integer(object, name);
  if (!integer) {
    return -1;
  }
  size_t value = PyLong_AsSize_t(integer);
  if (value == (size_t)-1 && PyErr_Occurred()) {
    PyErr_Format(PyExc_ValueError, "%s must be an address, got %R", name, integer);
  }
  Py_DECREF(integer);
  *out = value;
  return PyErr_Occurred() ? -1 : 0;
}

int bd_convert_text(PyObject *object, const char *name, const char **out) {
  Py_ssize_t length = 0;
  if (!PyUnicode_Check(object)) {
    return bd_convert_refuse(object, name, "a str");
  }
  *out = PyUnicode_AsUTF8AndSize(object, &length);
  if (*out && strlen(*out) != (size_t)length) {
    PyErr_Format(PyExc_ValueError, "%s must not contain a null character", name);
  }
  return PyErr_Occurred() ? -1 : 0;
}

/* --- arguments of a call ---------------------------------------------------------------------- */

static int convert(PyObject *object, const bd_argument *row) {
  switch (row->kind) {
  case BD_REAL:
    return bd_convert_real(object, row->name, row->to);
  case BD_FINITE:
    return bd_convert_finite(object, row->name, row->to);
  case BD_LONG:
    return bd_convert_long(object, row->name, row->to);
  case BD_BOOL:
    return bd_convert_bool(object, row->name, row->to);
  case BD_STR:
    return bd_convert_text(object, row->name, row->to);
  default:
    *(PyObject **)row->to = object;
    return 0;
  }
}

int bd_convert_arguments(PyObject *args, PyObject *keywords, const char *function, int required,
                         int positional, const bd_argument *rows) {
  char *names[BD_MAX_ARGUMENTS + 1] = {NULL}, format[BD_MAX_ARGUMENTS + 40], *at = format;
  PyObject *o[BD_MAX_ARGUMENTS] = {NULL};
  for (int k = 0; rows[k].name; k++) {
    if (k == BD_MAX_ARGUMENTS) {
      PyErr_BadInternalCall();
      return -1;
    }
    names[k] = (char *)rows[k].name;
    at += PyOS_snprintf(at, 4, "%s%sO", k == required ? "|" : "", k == positional ? "$" : "");
  }
  PyOS_snprintf(at, 36, ":%s", function);
  /* those that the format has no letter for are not looked at */
  if (!PyArg_ParseTupleAndKeywords(args, keywords, format, names, &o[0], &o[1], &o[2], &o[3], &o[4],
                                   &o[5], &o[6], &o[7], &o[8], &o[9], &o[10], &o[11], &o[12],
                                   &o[13], &o[14])) {
    return -1;
  }
  for (int k = 0; rows[k].name; k++) {
    if (o[k] && convert(o[k], &rows[k]) < 0) {
      return -1;
    }
  }
  return 0;
}

/* --- arrays ---------------------------------------------------------------------------------- */

int bd_convert_is_real(PyArrayObject *array) {
  int type = PyArray_TYPE(array);
  return type != NPY_BOOL && PyArray_CanCastSafely(type, NPY_DOUBLE);
}

void bd_convert_shape_text(char text[BD_SHAPE_SIZE], int ndim, const npy_intp *shape) {
  size_t at = 0;
  text[at++] = '(';
  /* A dimension has at most 20 digits: stop while one more and the end still fit. */
  for (int k = 0; k < ndim; k++) {
    const char *separator = k + 1 < ndim ? ", " : ndim == 1 ? "," : "";
    if (at + 32 > BD_SHAPE_SIZE) {
      at += (size_t)PyOS_snprintf(text + at, BD_SHAPE_SIZE - at, "...");
      break;
    }
    if (shape[k] == BD_ANY) {
      at += (size_t)PyOS_snprintf(text + at, BD_SHAPE_SIZE - at, "n%s", separator);
    } else {
      at += (size_t)PyOS_snprintf(text + at, BD_SHAPE_SIZE - at, "%lld%s", (long long)shape[k],
                                  separator);
    }
  }
  text[at++] = ')';
  text[at] = '\0';
}

static int check_shape(PyArrayObject *array, const char *name, int ndim, const npy_intp *shape) {
  int same = ndim == BD_ANY || PyArray_NDIM(array) == ndim;
  for (int k = 0; same && k < ndim; k++) {
    same = shape[k] == BD_ANY || PyArray_DIM(array, k) == shape[k];
  }
  if (same) {
    return 0;
  }
  char expected[BD_SHAPE_SIZE], got[BD_SHAPE_SIZE];
  bd_convert_shape_text(expected, ndim, shape);
  bd_convert_shape_text(got, PyArray_NDIM(array), PyArray_DIMS(array));
  PyErr_Format(PyExc_ValueError, "%s must have shape %s, got %s", name, expected, got);
  return -1;
}

/* "[3]", "[1, 0]" of a flat index; "" for a 0-d array. */
static void index_text(char text[BD_SHAPE_SIZE], PyArrayObject *array, npy_intp flat) {
  npy_intp index[NPY_MAXDIMS];
  int ndim = PyArray_NDIM(array);
  for (int k = ndim - 1; k >= 0; k--) {
    index[k] = flat % PyArray_DIM(array, k);
    flat /= PyArray_DIM(array, k);
  }
  size_t at = 0;
  text[0] = '\0';
  for (int k = 0; k < ndim && at + 32 < BD_SHAPE_SIZE; k++) {
    at += (size_t)PyOS_snprintf(text + at, BD_SHAPE_SIZE - at, "%s%lld%s", k ? ", " : "[",
                                (long long)index[k], k + 1 < ndim ? "" : "]");
  }
}

static int check_finite(PyArrayObject *array, const char *name) {
  const double *value = PyArray_DATA(array);
  npy_intp n = PyArray_SIZE(array);
  for (npy_intp i = 0; i < n; i++) {
    if (isfinite(value[i])) {
      continue;
    }
    char index[BD_SHAPE_SIZE];
    index_text(index, array, i);
    PyErr_Format(PyExc_ValueError, "%s%s must be finite, got %s", name, index,
                 not_finite_text(value[i]));
    return -1;
  }
  return 0;
}

PyArrayObject *bd_convert_array(PyObject *object, const char *name, int ndim,
                                const npy_intp *shape) {
  if (refuse_masked(object, name) < 0) {
    return NULL;
  }
  /* As it is first: the kind and shape given are what the messages must speak of. */
  PyArrayObject *given = (PyArrayObject *)PyArray_FROM_O(object);
  if (!given) {
    if (PyErr_ExceptionMatches(PyExc_ValueError)) { /* ragged nested sequences */
      PyErr_Format(PyExc_ValueError, "%s must be an array: its rows differ in length", name);
    }
    return NULL;
  }
  PyArrayObject *array = NULL;
  if (refuse_masked((PyObject *)given, name) < 0) { /* what its __array__ gave */
    goto out;
  }
  if (!bd_convert_is_real(given)) {
    PyErr_Format(PyExc_TypeError, "%s must hold real numbers, got dtype %S", name,
                 (PyObject *)PyArray_DESCR(given));
    goto out;
  }
  if (check_shape(given, name, ndim, shape) < 0) {
    goto out;
  }
  array = (PyArrayObject *)PyArray_FROMANY((PyObject *)given, NPY_DOUBLE, 0, 0,
                                           NPY_ARRAY_IN_ARRAY | NPY_ARRAY_ENSUREARRAY |
                                               NPY_ARRAY_ENSURECOPY);
  if (array && check_finite(array, name) < 0) {
    Py_CLEAR(array);
  }
out:
  Py_DECREF(given);
  return array;
}

int bd_convert_numbers(PyObject *object, const char *name, npy_intp n, double *out) {
  PyArrayObject *array = bd_convert_array(object, name, 1, &n);
  if (!array) {
    return -1;
  }
  memcpy(out, PyArray_DATA(array), (size_t)n * sizeof *out);
  Py_DECREF(array);
  return 0;
}
