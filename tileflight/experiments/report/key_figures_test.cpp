#include "tileflight/experiments/report/key_figures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/evaluation/metrics/published_results.h"

namespace tileflight::report::key_figures_files_test {
namespace {

using Rows = std::vector<std::vector<std::string>>;

KeyFigures some_figures() {
  const nlohmann::json flight{{"map", {{"points", 2000}, {"correspondences", 862}, {"mean", 0.51234}}},
                              {"resolution", {320, 180}},
                              {"kind", "surrogate"}};
  return key_figures({{"paper", metrics::published_table()}, {"simulated", flight}, {"real", flight}});
}

/// A reader of RFC 4180's grammar, one character at a time.
Rows read_csv(const std::string& csv) {
  Rows rows{{""}};
  bool quoted = false;
  for (std::size_t i = 0; i < csv.size(); ++i) {
    std::string& field = rows.back().back();
    if (quoted && csv[i] == '"' && i + 1 < csv.size() && csv[i + 1] == '"') {
      field += csv[i++];
    } else if (csv[i] == '"') {
      quoted = !quoted;
    } else if (!quoted && csv[i] == ',') {
      rows.back().emplace_back();
    } else if (!quoted && csv.compare(i, 2, "\r\n") == 0) {
      rows.push_back({""});
      ++i;
    } else {
      field += csv[i];
    }
  }
  EXPECT_FALSE(quoted);
  EXPECT_EQ(rows.back(), std::vector<std::string>{""}) << "the last line ends, too";
  rows.pop_back();
  return rows;
}

/// The rows that the table shows: label, then the cells.
Rows expected_rows(const KeyFigures& figures) {
  Rows rows;
  for (const auto* part : {&figures.as_published, &figures.additional}) {
    for (const KeyFigureRow& row : *part) {
      rows.push_back({row.label});
      for (const std::string& cell : row.cells) rows.back().push_back(cell == drawing::kUnknown ? "" : cell);
    }
  }
  return rows;
}

std::size_t occurrences(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++count;
  return count;
}

TEST(KeyFiguresFiles, CsvReadsBackAsTheTable) {
  const KeyFigures figures = some_figures();
  Rows rows = read_csv(key_figures_csv(figures));
  EXPECT_EQ(rows.front(), (std::vector<std::string>{"Figure", "Paper: Simulated", "Paper: Real", "This run: Simulated",
                                                    "This run: Surrogate"}));
  rows.erase(rows.begin());
  EXPECT_EQ(rows, expected_rows(figures));
  EXPECT_EQ(rows[0], (std::vector<std::string>{"Map points", "84,029", "71,918", "2,000", "2,000"}));
  EXPECT_EQ(rows[3][3], "") << "no deviation is known";
}

TEST(KeyFigures, WithoutAPlaceThereIsNothingToComparePublishedNumbersWith) {
  const nlohmann::json flight{{"resolution", {854, 480}},
                              {"kind", "video"},
                              {"trajectory", {{"ate_rmse", 0.5}, {"receiver", {{"expected_rmse_m", 2.449}}}}}};
  const nlohmann::json results{{"paper", metrics::published_table()}, {"truth", nullptr}, {"real", flight}};
  EXPECT_EQ(expected_rows(key_figures(results)), (Rows{{"Resolution, px", "854\u00D7480"},
                                                       {"Path error (ATE), m", "0.500"},
                                                       {"ATE of a perfect path, by the reference, m", "2.449"}}));
  EXPECT_EQ(verdict(results),
            "No place was given, so the error of the map is not known. The path differs from the recorded positions "
            "by 0.500 m (RMS).");
}

TEST(KeyFiguresFiles, CsvQuotesWhatNeedsIt) {
  KeyFigures figures;
  figures.columns = {{"simulated", "He said \"two\"", false, {}}};
  figures.as_published = {{"a, b\r\nc", {"1,000"}}};
  EXPECT_EQ(read_csv(key_figures_csv(figures)),
            (Rows{{"Figure", "This run: He said \"two\""}, {"a, b\r\nc", "1,000"}}));
}

TEST(KeyFiguresFiles, LatexHasBooktabsRulesAndFullRows) {
  const KeyFigures figures = some_figures();
  const std::string table = key_figures_latex(figures);
  for (const char* once :
       {"\\begin{tabular}{lrrrr}\n", "\\toprule\n", "\\bottomrule\n", "\\end{tabular}\n",
        "\\multicolumn{2}{c}{Paper} & \\multicolumn{2}{c}{This run} \\\\\n",
        "\\cmidrule(lr){2-3}\n\\cmidrule(lr){4-5}\n", "Mean error, m & 0.5548 & 0.5733 & 0.5123 & 0.5123 \\\\\n",
        "2688$\\times$1512", "Field of view, $^{\\circ}$ & ", "43.1~\\%"}) {
    EXPECT_GE(occurrences(table, once), 1u) << once << "\n" << table;
  }
  EXPECT_EQ(occurrences(table, "\\midrule\n"), 2u);
  EXPECT_TRUE(std::all_of(table.begin(), table.end(), [](char c) { return (c & 0x80) == 0; })) << table;
  std::istringstream lines(table);
  std::size_t rows = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.ends_with("\\\\") || line.find("multicolumn") != std::string::npos) continue;
    EXPECT_EQ(occurrences(line, " & "), 4u) << line;
    ++rows;
  }
  EXPECT_EQ(rows, 1 + figures.as_published.size() + figures.additional.size());
}

TEST(KeyFiguresFiles, LatexOfNoFlightIsStillATable) {
  const std::string table = key_figures_latex(key_figures(nlohmann::json::object()));
  EXPECT_NE(table.find("\\begin{tabular}{l}\n\\toprule\n"), std::string::npos) << table;
  EXPECT_EQ(table.find("cmidrule"), std::string::npos);
}

TEST(KeyFiguresFiles, LatexEscapesEverySpecialCharacter) {
  EXPECT_EQ(latex_text("a\\b&c%d$e#f_g{h}i~j^k"),
            "a\\textbackslash{}b\\&c\\%d\\$e\\#f\\_g\\{h\\}i\\textasciitilde{}j\\textasciicircum{}k");
  EXPECT_EQ(latex_text("43.1\u00A0% \u2212 155\u00B0 2\u00D73 \u2013"), "43.1~\\% $-$ 155$^{\\circ}$ 2$\\times$3 --");
}

TEST(KeyFiguresFiles, AreWritten) {
  const tests::TemporaryFolder folder;
  write_key_figures(folder / "tables", some_figures());
  EXPECT_EQ(base::read_text(folder / "tables/key-figures.csv"), key_figures_csv(some_figures()));
  EXPECT_EQ(base::read_text(folder / "tables/key-figures.tex"), key_figures_latex(some_figures()));
}

}  // namespace
}  // namespace tileflight::report::key_figures_files_test
