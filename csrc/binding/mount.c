/* SPDX-License-Identifier: MIT
 *
 * The mount of a pulley, read from an argument of Model by the tables of mounts (model/mount.c) and
 * of parameters. Guarded by tests/test_module.py.
 */
#include "binding/binding.h"

#include <string.h>

static PyArrayObject *read_array(PyObject *object, const char *label, const char *name, int ndim,
                                 const npy_intp *shape) {
  char field[BD_NAME_SIZE];
  PyOS_snprintf(field, sizeof field, "%s.%s", label, name);
  return bd_convert_array(object, field, ndim, shape);
}

/* The pair that says along what it moves. */
static int read_guide(PyObject *pair, const char *label, const char *guide, bd_mount *mount) {
  const npy_intp two = 2;
  PyArrayObject *array = read_array(pair, label, guide, 1, &two);
  if (!array) {
    return -1;
  }
  memcpy(mount->guide, PyArray_DATA(array), sizeof mount->guide);
  Py_DECREF(array);
  return 0;
}

/* Times and displacements; the arrays stay in `keep`. */
static int read_points(PyObject *times, PyObject *displacement, const char *label, bd_mount *mount,
                       PyObject *keep) {
  npy_intp n = BD_ANY;
  PyArrayObject *t = read_array(times, label, "t", 1, &n), *points = NULL;
  int failed = -1;
  if (t) {
    const npy_intp pairs[2] = {PyArray_DIM(t, 0), 2};
    points = read_array(displacement, label, "displacement", 2, pairs);
  }
  if (points && PyList_Append(keep, (PyObject *)t) == 0 &&
      PyList_Append(keep, (PyObject *)points) == 0) {
    mount->n_t = (size_t)PyArray_DIM(t, 0);
    mount->t = PyArray_DATA(t);
    mount->displacement = PyArray_DATA(points);
    failed = 0;
  }
  Py_XDECREF(t);
  Py_XDECREF(points);
  return failed;
}

static int read_kind(const char *kind, const char *label, const char **guide, bd_mount *mount) {
  const char *name;
  for (int k = 0; (name = bd_mount_name(k, guide)); k++) {
    if (strcmp(kind, name) == 0) {
      mount->kind = k;
      return 0;
    }
  }
  PyErr_Format(PyExc_ValueError, "%s: there is no mount '%.50s'", label, kind);
  return -1;
}

int bd_core_read_mount(PyObject *entry, const char *label, bd_mount *mount, PyObject *keep) {
  const char *kind = NULL;
  PyObject *first, *second;
  if (!PyTuple_Check(entry) || !PyArg_ParseTuple(entry, "sOO", &kind, &first, &second)) {
    PyErr_Format(PyExc_TypeError,
                 "%s must be a tuple (kind, pair, numbers) or (kind, t, displacement), got %R",
                 label, entry);
    return -1;
  }
  const char *guide;
  if (read_kind(kind, label, &guide, mount) < 0) {
    return -1;
  }
  if (!guide) {
    return read_points(first, second, label, mount, keep);
  }
  return read_guide(first, label, guide, mount) < 0
             ? -1
             : bd_core_read_group(second, kind, label, &mount->numbers);
}

PyObject *bd_core_mount_directions(PyObject *Py_UNUSED(module), PyObject *args) {
  const npy_intp pairs[2] = {BD_ANY, 2};
  const char *kind, *guide;
  PyObject *pair, *places;
  bd_mount mount = {0};
  if (!PyArg_ParseTuple(args, "sOO:mount_directions", &kind, &pair, &places) ||
      read_kind(kind, "mount", &guide, &mount) < 0) {
    return NULL;
  }
  if (!guide) {
    return PyErr_Format(PyExc_ValueError, "mount: the direction of a %s is that of its points",
                        kind);
  }
  PyArrayObject *centers = read_guide(pair, "mount", guide, &mount) < 0
                               ? NULL
                               : bd_convert_array(places, "centers", 2, pairs);
  PyArrayObject *out =
      centers ? (PyArrayObject *)PyArray_SimpleNew(2, PyArray_DIMS(centers), NPY_DOUBLE) : NULL;
  for (npy_intp k = 0; out && k < PyArray_DIM(out, 0); k++) {
    bd_mount_direction(&mount, PyArray_GETPTR1(centers, k), PyArray_GETPTR1(out, k));
  }
  Py_XDECREF(centers);
  return (PyObject *)out;
}
