// Makes what several tests start from, once for all of their processes (tests/shared_result.h).
#include <gtest/gtest.h>

#include "tests/tiny_experiments.h"
#include "tests/tiny_flight.h"

namespace tileflight::shared_results_test {
namespace {

TEST(SharedResults, AreMade) {
  const char* folder = std::getenv("TILEFLIGHT_SHARED_RESULTS");
  if (folder == nullptr) GTEST_SKIP() << "no folder is set; each process makes its own";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  for (const tests::SharedResult& result : {tests::TinyExperiments::two_flights(), tests::TinyExperiments::one_flight(),
                                            tests::TinyFlight::shared_dataset()}) {
    ASSERT_NO_THROW(result.make(std::filesystem::path(folder) / result.name)) << result.name;
  }
}

}  // namespace
}  // namespace tileflight::shared_results_test
