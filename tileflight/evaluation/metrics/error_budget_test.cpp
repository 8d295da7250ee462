#include "tileflight/evaluation/metrics/error_budget.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics::error_budget_test {
namespace {

ErrorBudgetInputs some_inputs() {
  return {.floor_rmse_m = 0.5,
          .geometric_error_m = 2.0,
          .alignment_sigma_m = 0.3,
          .rms_to_true_poses_m = 0.7,
          .surface_m = {0.5, 0.5, 0.5, 7.0},
          .within_m = 1.0};
}

TEST(ErrorBudget, SquaresAddUp) {
  const ErrorBudget b = error_budget(some_inputs());
  EXPECT_DOUBLE_EQ(*b.total_m, 0.5) << "7 m is no error of the map's points near the surface";
  EXPECT_DOUBLE_EQ(b.share_within, 0.75);
  EXPECT_NEAR(*b.odometry.value_m, 0.4, 1e-12);
  EXPECT_DOUBLE_EQ(*b.voxel.value_m, 0.5);
  EXPECT_DOUBLE_EQ(*b.tiles.value_m, 2.0);
  EXPECT_DOUBLE_EQ(*b.alignment.value_m, 0.3);
  EXPECT_DOUBLE_EQ(*b.path.value_m, 0.7);
}

TEST(ErrorBudget, WhatIsNotKnownIsNull) {
  ErrorBudgetInputs inputs = some_inputs();
  inputs.alignment_sigma_m.reset();
  inputs.rms_to_true_poses_m.reset();
  inputs.floor_rmse_m = std::numeric_limits<double>::quiet_NaN();
  inputs.geometric_error_m.reset();
  const ErrorBudget b = error_budget(inputs);
  EXPECT_FALSE(b.alignment.value_m);
  EXPECT_FALSE(b.path.value_m);
  EXPECT_FALSE(b.voxel.value_m);
  EXPECT_FALSE(b.tiles.value_m);
  EXPECT_DOUBLE_EQ(*b.odometry.value_m, 0.5) << "all of it is left";
  EXPECT_EQ(b.not_separated.size(), 3u);
  inputs.surface_m = {5.0};
  EXPECT_FALSE(error_budget(inputs).odometry.value_m);
  EXPECT_EQ(error_budget(inputs).share_within, 0.0);
}

TEST(ErrorBudget, AnAlignmentLessCertainThanTheTotalLeavesNothing) {
  ErrorBudgetInputs inputs = some_inputs();
  inputs.alignment_sigma_m = 0.8;
  EXPECT_EQ(*error_budget(inputs).odometry.value_m, 0.0);
}

TEST(ErrorBudget, AReferenceIsStatedBesideThePathThatHoldsIt) {
  EXPECT_FALSE(error_budget(some_inputs()).reference);
  ErrorBudgetInputs inputs = some_inputs();
  inputs.reference_sigma_m = 0.2;
  const ErrorBudget b = error_budget(inputs);
  EXPECT_DOUBLE_EQ(*b.reference->value_m, 0.2);
  EXPECT_NE(b.path.explanation.find("located in the tiles"), std::string::npos);
  EXPECT_DOUBLE_EQ(*b.odometry.value_m, *error_budget(some_inputs()).odometry.value_m) << "distances do not hold it";
}

TEST(ErrorBudget, RoundTripAndComplaints) {
  ErrorBudgetInputs inputs = some_inputs();
  inputs.reference_sigma_m = 0.2;
  const nlohmann::json with_reference = to_json(error_budget(inputs));
  EXPECT_EQ(to_json(read_error_budget(base::StrictSection(with_reference, "m.json"))), with_reference);
  const nlohmann::json written = to_json(error_budget(some_inputs()));
  EXPECT_EQ(to_json(read_error_budget(base::StrictSection(written, "m.json"))), written);
  nlohmann::json broken = written;
  broken["tiles"].erase("kind");
  EXPECT_EQ(tests::refusal_of([&] { read_error_budget(base::StrictSection(broken, "m.json")); }),
            "m.json: 'tiles.kind' is missing");
}

}  // namespace
}  // namespace tileflight::metrics::error_budget_test
