#include "tileflight/experiments/report/ablation_table.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

namespace tileflight::report::ablation_table_test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

json results_of_two() {
  json good{{"name", "as it is"},   {"failed", nullptr},    {"frames_tracked", 342},
            {"points", 50585},      {"mean_m", 0.44734},    {"median_to_surface_m", 0.0402},
            {"ate_rmse_m", 0.0241}, {"ate_share", 0.000102}};
  json bad{{"name", "blur-\u00b5"}, {"failed", "lost at frame 7"}};
  return {{"ablation", json::array({good, bad})}};
}

TEST(AblationTable, HasARowAVariant) {
  const std::string html = to_html(ablation_table(results_of_two())).str();
  for (const char* cell : {">as it is</th>", ">342</td>", ">50,585</td>", ">0.4473</td>", ">0.0402</td>",
                           ">0.0241</td>", ">0.010</td>", ">no map</td>"}) {
    EXPECT_THAT(html, HasSubstr(cell));
  }
}

TEST(AblationTable, LinesOfTextAreOfOneWidth) {
  std::istringstream text(ablation_text(results_of_two()));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0].size(), lines[1].size());
  EXPECT_THAT(lines[1], testing::StartsWith("as it is"));
  EXPECT_THAT(lines[2], HasSubstr("no map"));
}

TEST(AblationTable, WithoutVariantsThereIsNone) {
  EXPECT_TRUE(ablation_table(json::object()).rows.empty());
  EXPECT_EQ(ablation_text({{"ablation", nullptr}}), "");
}

}  // namespace
}  // namespace tileflight::report::ablation_table_test
