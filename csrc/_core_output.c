/* SPDX-License-Identifier: MIT
 *
 * The arrays a run fills: allocated by NumPy before it, written by the core while it goes on.
 * Guarded by tests/test_module_run.py (shapes, contents) and tests/test_lifetime.py (who owns
 * them).
 */
#include "_core.h"

#include <math.h>

/* A fresh (rows, columns) array whose every byte pattern means "not written yet": NaN or -1. It is
 * kept in `keep`; the dict gets a view, which cannot be resized. */
static void *add_output(PyObject *keep, PyObject *dict, const char *name, int type, npy_intp rows,
                        npy_intp columns) {
  const npy_intp shape[2] = {rows, columns};
  void *data = NULL;
  PyObject *array = PyArray_SimpleNew(2, shape, type);
  PyObject *fill = type == NPY_DOUBLE ? PyFloat_FromDouble(NAN) : PyLong_FromLong(-1);
  if (array && fill && PyArray_FillWithScalar((PyArrayObject *)array, fill) == 0 &&
      PyList_Append(keep, array) == 0 &&
      bd_core_set(dict, name, PyArray_View((PyArrayObject *)array, NULL, NULL)) == 0) {
    data = PyArray_DATA((PyArrayObject *)array);
  }
  Py_XDECREF(fill);
  Py_XDECREF(array);
  return data;
}

enum { WIDTH_PULLEYS, WIDTH_LINKS, WIDTH_ENERGY };

int bd_core_output_new(bd_output *output, PyObject *keep, PyObject *dict, const bd_info *info,
                       int ledger, npy_intp rows) {
  const npy_intp width[] = {
      [WIDTH_PULLEYS] = info->n_pulleys,
      [WIDTH_LINKS] = info->n_bodies,
      [WIDTH_ENERGY] = ledger ? BD_N_ENERGY : 0,
  };
#define X(name, group, size, unit, text)                                                           \
  if (width[WIDTH_##size]) {                                                                       \
    output->name = add_output(keep, dict, #name, NPY_DOUBLE, rows, width[WIDTH_##size]);           \
    if (!output->name)                                                                             \
      return -1;                                                                                   \
  }
  BD_OUTPUTS(X)
#undef X
  output->pulley = add_output(keep, dict, "pulley", NPY_INT32, rows, width[WIDTH_LINKS]);
  return output->pulley ? 0 : -1;
}
