# What other compiled rooms call.

cdef void correct(double* raw, const double* correction, double* true) noexcept nogil
