#include "tileflight/evaluation/metrics/student_t.h"

#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/beta.hpp>
#include <cassert>

namespace tileflight::metrics {

namespace {

namespace policies = boost::math::policies;
/// Unknown arguments (NaN) give NaN instead of an exception.
using NaNOnError =
    policies::policy<policies::domain_error<policies::ignore_error>, policies::overflow_error<policies::ignore_error>,
                     policies::evaluation_error<policies::ignore_error>, policies::promote_double<false>>;
using StudentT = boost::math::students_t_distribution<double, NaNOnError>;

}  // namespace

double incomplete_beta(double x, double a, double b) { return boost::math::ibeta(a, b, x, NaNOnError()); }

double student_t_cdf(double t, double degrees_of_freedom) {
  assert(degrees_of_freedom > 0.0);
  return boost::math::cdf(StudentT(degrees_of_freedom), t);
}

double student_t_quantile(double probability, double degrees_of_freedom) {
  assert(probability > 0.0 && probability < 1.0);
  return boost::math::quantile(StudentT(degrees_of_freedom), probability);
}

}  // namespace tileflight::metrics
