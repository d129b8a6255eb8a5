/* SPDX-License-Identifier: MIT
 *
 * Python's containers from C values, item by item. Guarded by tests/test_module.py (contents) and
 * tests/test_lifetime.py (references).
 */
#include "binding/binding.h"

int bd_core_set(PyObject *dict, const char *name, PyObject *value) {
  if (!value) {
    return -1;
  }
  int failed = PyDict_SetItemString(dict, name, value);
  Py_DECREF(value);
  return failed;
}

PyObject *bd_core_append(PyObject *list, PyObject *value) {
  if (list && (!value || PyList_Append(list, value) < 0)) {
    Py_CLEAR(list);
  }
  Py_XDECREF(value);
  return list;
}

PyObject *bd_core_tuple(PyObject *list) {
  PyObject *tuple = list ? PyList_AsTuple(list) : NULL;
  Py_XDECREF(list);
  return tuple;
}
