// Makes what several tests start from, once for all of their processes (tests/shared_result.h).
#include <gtest/gtest.h>

#include <vector>

#include "tests/all_stages.h"
#include "tests/rolling_ground.h"
#include "tests/shared_stadium.h"
#include "tests/tiny_experiments.h"
#include "tests/tiny_flight.h"

namespace tileflight::shared_results_test {
namespace {

void make_anew(const std::vector<tests::SharedResult>& results) {
  const char* folder = std::getenv("TILEFLIGHT_SHARED_RESULTS");
  if (folder == nullptr) GTEST_SKIP() << "no folder is set; each process makes its own";
  std::filesystem::create_directories(folder);
  for (const tests::SharedResult& result : results) {
    const std::filesystem::path made = std::filesystem::path(folder) / result.name;
    std::filesystem::remove_all(made);
    ASSERT_NO_THROW(result.make(made)) << result.name;
  }
}

TEST(SharedResults, AreMade) {
  make_anew({tests::TinyExperiments::two_flights(), tests::TinyExperiments::one_flight(),
             tests::TinyFlight::shared_dataset(), tests::rolling_ground(), tests::AllStages::usual()});
}

TEST(SharedResults, StadiumIsWritten) { make_anew({tests::shared_stadium()}); }

}  // namespace
}  // namespace tileflight::shared_results_test
