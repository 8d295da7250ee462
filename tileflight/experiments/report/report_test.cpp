#include "tileflight/experiments/report/report.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/web/synthetic_run.h"
#include "tileflight/core/base/files.h"
#include "tileflight/experiments/report/key_figures.h"

namespace tileflight::report::report_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class Report : public testing::Test {
 protected:
  void make(const tests::SyntheticRun::Options& options = {.map_points = 2000}) {
    tests::SyntheticRun(run_, options).write();
  }
  std::string page() {
    write_report(run_, quick());
    return base::read_text(run_ / "report.html");
  }
  /// Small limits, so that the view is built quickly.
  static ReportOptions quick() {
    ReportOptions options;
    options.view.place = {.max_triangles = 500, .texture_px = 64};
    options.view.max_map_points = 300;
    options.view.max_frames = 3;
    options.view.frame_width_px = 32;
    return options;
  }
  /// The page without the program's own script and the view's data.
  static std::string without_view(std::string html) {
    for (const char* begin : {"<script type=\"application/octet-stream\" id=\"view-data\">", "<script>"}) {
      const std::size_t from = html.find(begin);
      if (from != std::string::npos) html.erase(from, html.find("</script>", from) - from);
    }
    return html;
  }
  nlohmann::json results() { return nlohmann::json::parse(base::read_text(run_ / "results.json")); }
  void write_results(const nlohmann::json& value) { std::ofstream(run_ / "results.json") << value.dump(); }
  std::string fault() {
    return tests::refusal_of([&] { write_report(run_, quick()); });
  }

  tests::TemporaryFolder folder_;
  fs::path run_ = folder_ / "run";
};

TEST_F(Report, ShowsTheKeyFiguresOfThePaperAndOfTheRun) {
  make();
  const std::string html = page();
  for (const char* published :
       {"84,029", "36,178", "0.5548", "0.1885", "71,918", "27,820", "0.5733", "0.1998", "2688\u00D71512", "1,000"}) {
    EXPECT_THAT(html, HasSubstr(">" + std::string(published) + "</td>"));
  }
  const nlohmann::json run = results();
  for (const char* key : {"simulated", "real"}) {
    std::string mean =
        std::to_string(run[key]["map"]["mean"].get<double>() + 5e-5);  // cut to four decimals below: rounded
    EXPECT_THAT(html, HasSubstr(">" + mean.substr(0, 6) + "</td>"));
  }
  for (const char* own : {"0.4810", "0.1200", "Simulation predicted the surrogate", "\u22120.0271 to \u22120.0102",
                          "20.2", "aaaaaaaa", "cccccccc", "0123456789ab", "Synthetic data"}) {
    EXPECT_THAT(html, HasSubstr(own));
  }
}

TEST_F(Report, SaysHowAlikeAFollowedFlightIs) {
  make();
  EXPECT_THAT(page(), Not(HasSubstr("follows the other one")));
  nlohmann::json value = results();
  const auto spread = [](double p10, double median, double p90) {
    return nlohmann::json{{"p10", p10}, {"median", median}, {"p90", p90}};
  };
  value["reproduction"] = {{"pairs", 200},
                           {"poses", "true"},
                           {"overlap", spread(0.987, 0.998, 1.0)},
                           {"ncc", spread(0.8961, 0.9123, 0.9234)},
                           {"ssim", nullptr},
                           {"position_m", spread(0.041, 0.066, 0.101)},
                           {"rotation_deg", spread(0.1, 0.12, 0.13)},
                           {"time_offset_s", -0.009}};
  write_results(value);
  const std::string html = page();
  for (const char* said : {"follows the other one: 200 pairs of images, true poses", ">0.998</td>", ">0.912</td>",
                           ">0.066</td>", "\u22120.009"}) {
    EXPECT_THAT(html, HasSubstr(said));
  }
}

TEST_F(Report, ShowsPercentilesWhereTheRunHasThem) {
  make();
  EXPECT_THAT(page(), Not(HasSubstr("Percentiles of the map points")));
  nlohmann::json value = results();
  value["simulated"]["map"]["percentiles"] = {{"50", 0.51234}, {"99", 0.98765}};
  value["real"]["surface"]["percentiles"] = {{"50", 0.12345}, {"99", nullptr}};
  write_results(value);
  const std::string html = page();
  EXPECT_THAT(html, HasSubstr("Percentiles of the map points"));
  EXPECT_THAT(html, HasSubstr(">50\u00A0%</th><td>0.5123</td><td>\u2013</td><td>\u2013</td><td>0.1235</td>"));
  EXPECT_THAT(html, HasSubstr(">99\u00A0%</th><td>0.9877</td><td>\u2013</td><td>\u2013</td><td>\u2013</td>"));
  EXPECT_THAT(html, Not(HasSubstr(">25\u00A0%</th>"))) << "known of neither flight";
}

TEST_F(Report, HoldsEveryFigureAndLoadsNothing) {
  make();
  const std::string html = page();
  for (const char* figure : {"class=\"frames\"", "class=\"maps\"", "class=\"paths\"", "class=\"error-maps\"",
                             "Histogram of map errors", "Cumulative map error"}) {
    EXPECT_THAT(html, HasSubstr(figure));
  }
  const std::string own = without_view(html);
  EXPECT_THAT(own, Not(testing::ContainsRegex("src=\"[^d]")));
  EXPECT_THAT(own, Not(testing::ContainsRegex("href=\"[^d#frt]"))) << "parts, downloads, and files beside the page";
  EXPECT_THAT(own, Not(HasSubstr("<script")));
  EXPECT_THAT(own, Not(HasSubstr("://")));
  EXPECT_LT(html.size(), 15u << 20);
}

TEST_F(Report, AlignsTheEstimatedPath) {
  make();
  const std::string html = page();
  // The synthetic estimate wobbles around a truth of the same shape: were its transform not applied, the view would
  // reach far outside.
  EXPECT_THAT(html, HasSubstr("class=\"line simulated estimate\""));
  EXPECT_THAT(html.substr(html.find("class=\"paths\""), 20000), Not(HasSubstr(">200</text>")));
}

TEST_F(Report, TheSameRunGivesTheSameBytes) {
  make();
  EXPECT_EQ(base::sha256_hex(page()), base::sha256_hex(page()));
}

TEST_F(Report, TheIntervalSaysWhatItIsBy) {
  make();
  EXPECT_THAT(page(), HasSubstr("95 % interval (block bootstrap), m"));
  nlohmann::json value = results();
  value["comparison"]["unit"] = "runs";
  write_results(value);
  EXPECT_THAT(page(), HasSubstr("95 % interval (between runs, Welch&#39;s t), m"));
}

TEST_F(Report, EveryFigureAndItsNumbersAreFiles) {
  make();
  page();
  const nlohmann::json report = nlohmann::json::parse(base::read_text(run_ / "report.json"));
  std::size_t files = 0;
  for (const nlohmann::json& figure : report["figures"]) {
    for (const nlohmann::json& file : figure["files"]) {
      const std::string bytes = base::read_text(run_ / file.get<std::string>());
      if (file.get<std::string>().ends_with(".svg")) {
        EXPECT_THAT(bytes, testing::StartsWith("<svg xmlns=\"http://www.w3.org/2000/svg\"")) << file;
        EXPECT_THAT(bytes, Not(HasSubstr("var(--"))) << file;
      } else {
        EXPECT_THAT(bytes, HasSubstr("\r\n")) << file;
      }
      ++files;
    }
  }
  EXPECT_EQ(files, 14U);
}

TEST_F(Report, TheJsonHoldsWhatThePageSays) {
  make();
  const std::string html = page();
  const nlohmann::json report = nlohmann::json::parse(base::read_text(run_ / "report.json"));
  EXPECT_EQ(report["verdict"], verdict(results()));
  ASSERT_FALSE(report["key_figures"]["rows"].empty());
  for (const nlohmann::json& row : report["key_figures"]["rows"]) {
    for (const std::string cell : row["cells"]) EXPECT_THAT(html, HasSubstr(">" + cell + "</td>"));
  }
  std::vector<std::string> ids;
  for (const nlohmann::json& table : report["tables"]) {
    ids.push_back(table["id"]);
    for (const nlohmann::json& row : table["rows"]) EXPECT_EQ(row.size(), table["head"].size()) << table["id"];
  }
  EXPECT_THAT(ids, testing::ElementsAre("surface", "comparison", "parts", "trajectory", "tracking"));
  EXPECT_EQ(report["provenance"], results()["provenance"]);
}

TEST_F(Report, ThePathsErrorIsTheDistanceAtTheSameTime) {
  make();
  page();
  const nlohmann::json report = nlohmann::json::parse(base::read_text(run_ / "report.json"));
  for (const nlohmann::json& figure : report["figures"]) {
    if (figure["id"] != "path-error") continue;
    const nlohmann::json& points = figure["series"][0]["points"];
    ASSERT_EQ(points.size(), 121U);
    for (std::size_t i = 0; i < points.size(); ++i)  // the synthetic estimate wobbles so about the truth
      EXPECT_NEAR(points[i][1].get<double>(), std::abs(1.2 * std::sin(3 * 0.045 * static_cast<double>(i))), 1e-6);
    return;
  }
  FAIL() << "there is no such figure";
}

TEST_F(Report, PartsOfThePlaceAreCountedByTheirPoints) {
  make({.map_points = 9000});
  page();
  const nlohmann::json report = nlohmann::json::parse(base::read_text(run_ / "report.json"));
  for (const nlohmann::json& table : report["tables"]) {
    if (table["id"] != "parts") continue;
    ASSERT_EQ(table["rows"].size(), 9U);
    EXPECT_EQ(table["rows"][0][0], "North-west");
    for (const nlohmann::json& row : table["rows"]) {
      const std::string points = row[1];  // evenly spread: a ninth in each, less what noise moves across the border
      EXPECT_NEAR(std::stod(points.find(',') == std::string::npos ? points : points.substr(0, 1) + points.substr(2)),
                  1000, 120);
    }
    return;
  }
  FAIL() << "there is no such table";
}

TEST_F(Report, ASurrogateIsNeverCalledReal) {
  make({.kind = "surrogate", .map_points = 2000});
  EXPECT_THAT(page(), HasSubstr("The second flight is a surrogate"));
  EXPECT_EQ(flight_label("real", results()["real"]), "Surrogate");
  make({.kind = "video", .map_points = 2000});
  EXPECT_THAT(page(), Not(HasSubstr("urrogate")));
  EXPECT_EQ(flight_label("real", results()["real"]), "Real");
}

TEST_F(Report, HostileNamesStayText) {
  make({.name = "</title><script>alert(1)</script><img src=x onerror=alert(1)>\x01",
        .kind = "\"><b>",
        .map_points = 2000});
  const std::string html = without_view(page());
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("<img src=x")));
  EXPECT_THAT(html, Not(HasSubstr("<b>")));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;alert(1)"));
}

TEST_F(Report, OneFlightIsEnough) {
  make({.second_flight = false, .map_points = 2000});
  const std::string html = page();
  EXPECT_THAT(html, HasSubstr("there is no second flight to compare it with"));
  EXPECT_THAT(html, HasSubstr("the experiment has no second flight"));
  EXPECT_THAT(html, HasSubstr("class=\"frames\""));
}

TEST_F(Report, PartsThatAreMissingAreLeftOutAndNamed) {
  make();
  fs::remove_all(run_ / "truth");
  fs::remove_all(run_ / "simulated");
  fs::remove(run_ / "real/errors.ply");
  const std::string html = page();
  for (const char* part : {"truth/voxels.ply is not there", "simulated/transform.json is not there",
                           "simulated/dataset contains no images", "real/errors.ply is not there"}) {
    EXPECT_THAT(html, HasSubstr(part));
  }
  EXPECT_THAT(html, HasSubstr("Histogram of map errors"));  // its numbers are in results.json
  EXPECT_THAT(html, Not(HasSubstr("id=\"error-maps\"")));
}

TEST_F(Report, ResultsWithNothingInThemStillMakeAPage) {
  fs::create_directories(run_);
  write_results(nlohmann::json::object());
  EXPECT_THAT(page(), HasSubstr("This run has no scored map."));
}

TEST_F(Report, ResultsOfOtherTypesAreShownAsUnknown) {
  make();
  nlohmann::json value = results();
  value["simulated"]["map"] = {{"mean", "a lot"}, {"points", nullptr}, {"histogram", {1, 2}}};
  value["simulated"]["surface"] = nullptr;
  value["comparison"] = nullptr;
  value["provenance"] = {{"inputs", "none"}, {"seconds", 3}};
  value["truth"] = nullptr;
  value["paper"] = 7;
  write_results(value);
  EXPECT_THAT(page(), HasSubstr("there is no second flight to compare it with"));
}

TEST_F(Report, LostTrackingAndAlignmentThatDidNotConvergeAreSaid) {
  make();
  nlohmann::json value = results();
  value["real"]["odometry"]["lost"] = true;
  value["simulated"]["alignment"]["converged"] = false;
  const std::string sentence = verdict(value);
  EXPECT_THAT(sentence, HasSubstr("Tracking of the surrogate flight was lost before its end."));
  EXPECT_THAT(sentence, HasSubstr("The alignment of the simulated map did not converge."));
}

TEST_F(Report, AMeanBelowTheFloorIsExplained) {
  make();
  nlohmann::json value = results();
  EXPECT_THAT(remark_on_floor(value), Not(HasSubstr("A mean below the floor")));
  value["real"]["map"]["mean"] = 0.45;
  EXPECT_THAT(remark_on_floor(value), HasSubstr("A mean below the floor is not more accurate"));
  EXPECT_EQ(remark_on_floor(nlohmann::json::object()), "");
}

TEST_F(Report, TheVerdictFollowsTheEquivalenceTest) {
  make();
  nlohmann::json value = results();
  EXPECT_THAT(verdict(value), HasSubstr("Simulation predicted the surrogate flight's map error within 0.05 m: mean "));
  value["comparison"]["verdict"] = "different";
  EXPECT_THAT(verdict(value), HasSubstr("Simulation did not predict the surrogate flight's map error within 0.05 m"));
  value["comparison"]["verdict"] = "undecided";
  EXPECT_THAT(verdict(value), HasSubstr("Inconclusive"));
  value["comparison"] = nullptr;
  EXPECT_THAT(verdict(value), HasSubstr("The maps of both flights are scored: mean "));
}

TEST_F(Report, TheVerdictsMeansAreThoseOfTheRunsThatAreCompared) {
  make();
  nlohmann::json value = results();
  value["comparison"].update({{"unit", "runs"},
                              {"runs", {{"simulated", 6}, {"real", 4}}},
                              {"mean_difference", -0.0073},
                              {"mean_difference_ci95", {-0.0253, 0.0106}}});
  value["simulated"]["runs"]["spread"]["map"]["mean"]["mean"] = 0.4918;
  value["real"]["runs"]["spread"]["map"]["mean"]["mean"] = 0.4991;
  EXPECT_THAT(verdict(value),
              HasSubstr("mean 0.4918 m simulated over 6 runs, 0.4991 m surrogate over 4 runs, a difference of "
                        "\u22120.0073 m (95 % interval \u22120.0253 to +0.0106 m)"));
}

TEST_F(Report, BrokenPartsAreOneClearLine) {
  EXPECT_THAT(fault(), HasSubstr("no results.json here"));
  make();
  std::ofstream(run_ / "results.json") << "{\"name\": ";
  EXPECT_THAT(fault(), HasSubstr("results.json: not a JSON object"));
  make();
  nlohmann::json earlier = results();
  earlier["doubts"] = earlier["warnings"];
  earlier.erase("warnings");
  write_results(earlier);
  EXPECT_THAT(fault(), HasSubstr("results.json: 'doubts' is called 'warnings' now"));
  make();
  std::ofstream(run_ / "simulated/transform.json") << R"({"matrix": [[1, 0], [0, 1]]})";
  EXPECT_THAT(fault(), HasSubstr("transform.json: 'matrix' must be 4 x 4 numbers"));
  make();
  fs::resize_file(run_ / "truth/voxels.ply", 400);
  EXPECT_THAT(fault(), HasSubstr("voxels.ply"));
  make();
  fs::resize_file(run_ / "real/dataset/images/000003.jpg", 300);
  for (int i = 0; i <= 20; ++i) {
    std::string id = std::to_string(i);
    fs::resize_file(run_ / "real/dataset/images" / (id.insert(0, 6 - id.size(), '0') + ".jpg"), 300);
  }
  EXPECT_THAT(fault(), HasSubstr(".jpg"));
}

TEST_F(Report, TheTextTableHasThePapersColumnsBesideOurs) {
  make();
  const std::string table = results_table(results());
  EXPECT_THAT(table, testing::ContainsRegex("paper +paper +this run +this run\n"));
  EXPECT_THAT(table, testing::ContainsRegex("Simulated +Real +Simulated +Surrogate\n"));
  EXPECT_THAT(table, testing::ContainsRegex("Map points +84,029 +71,918 +2,000 +2,000\n"));
  EXPECT_THAT(table, testing::ContainsRegex("Mean error, m +0\\.5548 +0\\.5733 +0\\.[0-9]{4} +0\\.[0-9]{4}\n"));
  EXPECT_THAT(table, testing::ContainsRegex("Frames +342 +1,000 +121 +121\n"));
  EXPECT_THAT(table, testing::ContainsRegex("Path error \\(ATE\\), m .*0\\.210 +0\\.210\n"));
  EXPECT_THAT(results_table(nlohmann::json::object()), HasSubstr("Map points"));
}

}  // namespace
}  // namespace tileflight::report::report_test
