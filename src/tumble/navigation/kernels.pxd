# What other compiled rooms call: small arrays of numbers in, small arrays out.

cdef void ends_of_interval(
    double* before, double* mean, double* after, bint first, double interval, double previous_interval
) noexcept nogil

cdef void step_between(
    double* nav, double* place, double* old, double* new, double weight, double share, double interval
) noexcept nogil

cdef void advance(double* nav, double* before, double* after, double interval) noexcept nogil
