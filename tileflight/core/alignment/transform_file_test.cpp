#include "tileflight/core/alignment/transform_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment::transform_file_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

IcpResult some_result() {
  IcpResult result;
  result.T_target_source = {4.25, geometry::so3_exp({0.3, -0.2, 1.9}), {348.0, -131.5, 2893.25}};
  result.rmse_m = 0.4321;
  result.fitness = 0.61;
  result.correspondences = 36178;
  result.points = 84029;
  result.iterations = 152;
  result.converged = true;
  result.method = "icp-point-to-point";
  result.note = "a remark";
  result.remaining_motion_m = 0.002;
  result.constraint.eigenvalues = {0.1, 0.2};
  return result;
}

TEST(TransformFile, RoundTrip) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "transform.json", to_json(some_result()).dump());
  const IcpResult back = read_transform(folder / "transform.json");
  EXPECT_LT((back.T_target_source.matrix() - some_result().T_target_source.matrix()).norm(), 1e-9);
  EXPECT_EQ(to_json(back).at("rmse"), 0.4321);
  EXPECT_EQ(back.correspondences, 36178u);
  EXPECT_EQ(back.points, 84029u);
  EXPECT_EQ(back.iterations, 152);
  EXPECT_TRUE(back.converged);
  EXPECT_EQ(back.method, "icp-point-to-point");
  EXPECT_EQ(back.note, "a remark");
  EXPECT_EQ(back.constraint.eigenvalues, some_result().constraint.eigenvalues);
}

TEST(TransformFile, MatrixIsRowMajorWithTheScale) {
  const auto json = to_json(some_result());
  EXPECT_EQ(json.at("matrix")[0][3], 348.0);
  EXPECT_EQ(json.at("matrix")[2][3], 2893.25);
  EXPECT_EQ(json.at("matrix")[3], nlohmann::json({0.0, 0.0, 0.0, 1.0}));
  const geometry::Vec3 first_row(json.at("matrix")[0][0], json.at("matrix")[0][1], json.at("matrix")[0][2]);
  EXPECT_NEAR(first_row.norm(), 4.25, 1e-12);
  for (const char* key : {"matrix", "scale", "rmse", "fitness", "iterations", "converged", "method"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
}

TEST(TransformFile, AHandWrittenMatrixIsEnough) {
  const auto result =
      alignment_from_json({{"matrix", {{2, 0, 0, 5}, {0, 2, 0, 6}, {0, 0, 2, 7}, {0, 0, 0, 1}}}}, "start");
  EXPECT_DOUBLE_EQ(result.T_target_source.scale, 2.0);
  EXPECT_EQ(result.T_target_source.translation, geometry::Vec3(5, 6, 7));
}

TEST(TransformFile, BadFilesAreOneClearLine) {
  const tests::TemporaryFolder folder;
  const char* const bad[] = {
      "",
      "{\"matrix\": [[1,0,0,0],",
      "[]",
      "{}",
      "{\"matrix\": 3}",
      "{\"matrix\": [[1,0,0],[0,1,0],[0,0,1]]}",
      "{\"matrix\": [[1,0,0,\"a\"],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}",
      "{\"matrix\": [[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]}",
      "{\"matrix\": [[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]}",
      "{\"matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], \"scale\": 2}",
      "{\"matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], \"rmse\": \"small\"}",
  };
  for (const char* text : bad) {
    base::write_file(folder / "transform.json", text);
    try {
      read_transform(folder / "transform.json");
      ADD_FAILURE() << "accepted: " << text;
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("transform.json"), std::string::npos) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    }
  }
  EXPECT_THAT([&] { read_transform(folder / "absent.json"); },
              ThrowsMessage<InputError>(HasSubstr("absent.json: cannot be opened")));
}

}  // namespace
}  // namespace tileflight::alignment::transform_file_test
