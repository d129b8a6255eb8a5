/* SPDX-License-Identifier: MIT
 *
 * The mount of a pulley, read from an argument of Model. Guarded by tests/test_module.py.
 */
#include "binding/binding.h"

#include <string.h>

static int read_pair(PyObject *object, const char *label, const char *name, double out[2]) {
  const npy_intp two = 2;
  char field[BD_NAME_SIZE];
  PyOS_snprintf(field, sizeof field, "%s.%s", label, name);
  PyArrayObject *array = bd_convert_array(object, field, 1, &two);
  if (!array) {
    return -1;
  }
  memcpy(out, PyArray_DATA(array), 2 * sizeof *out);
  Py_DECREF(array);
  return 0;
}

/* ("path", t, displacement); the arrays stay in `keep`. */
static int read_path(PyObject *entry, const char *label, bd_mount *mount, PyObject *keep) {
  char field[BD_NAME_SIZE];
  npy_intp n = BD_ANY;
  PyOS_snprintf(field, sizeof field, "%s.t", label);
  PyArrayObject *t = bd_convert_array(PyTuple_GET_ITEM(entry, 1), field, 1, &n), *points = NULL;
  int failed = -1;
  if (t) {
    const npy_intp pairs[2] = {PyArray_DIM(t, 0), 2};
    PyOS_snprintf(field, sizeof field, "%s.displacement", label);
    points = bd_convert_array(PyTuple_GET_ITEM(entry, 2), field, 2, pairs);
  }
  if (points && PyList_Append(keep, (PyObject *)t) == 0 &&
      PyList_Append(keep, (PyObject *)points) == 0) {
    mount->kind = BD_MOUNT_PATH;
    mount->n_t = (size_t)PyArray_DIM(t, 0);
    mount->t = PyArray_DATA(t);
    mount->displacement = PyArray_DATA(points);
    failed = 0;
  }
  Py_XDECREF(t);
  Py_XDECREF(points);
  return failed;
}

int bd_core_read_mount(PyObject *entry, const char *label, bd_mount *mount, PyObject *keep) {
  const char *kind = PyTuple_Check(entry) && PyTuple_GET_SIZE(entry) == 3 &&
                             PyUnicode_Check(PyTuple_GET_ITEM(entry, 0))
                         ? PyUnicode_AsUTF8(PyTuple_GET_ITEM(entry, 0))
                         : NULL;
  if (!kind) {
    if (!PyErr_Occurred()) {
      PyErr_Format(PyExc_TypeError,
                   "%s must be a tuple (\"arm\", pivot, numbers), (\"slider\", direction, numbers) "
                   "or (\"path\", t, displacement), got %R",
                   label, entry);
    }
    return -1;
  }
  PyObject *place = PyTuple_GET_ITEM(entry, 1), *numbers = PyTuple_GET_ITEM(entry, 2);
  if (strcmp(kind, "path") == 0) {
    return read_path(entry, label, mount, keep);
  }
  if (strcmp(kind, "arm") == 0) {
    mount->kind = BD_MOUNT_ARM;
    return read_pair(place, label, "pivot", mount->pivot) < 0
               ? -1
               : bd_core_read_group(numbers, "arm", label, &mount->arm);
  }
  if (strcmp(kind, "slider") == 0) {
    mount->kind = BD_MOUNT_SLIDER;
    return read_pair(place, label, "direction", mount->direction) < 0
               ? -1
               : bd_core_read_group(numbers, "slider", label, &mount->slider);
  }
  PyErr_Format(PyExc_ValueError, "%s must be an \"arm\", a \"slider\" or a \"path\", got \"%.50s\"",
               label, kind);
  return -1;
}
