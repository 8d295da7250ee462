#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/report/figure.h"
#include "tileflight/report/key_figures.h"
#include "tileflight/report/run_folder.h"
#include "tileflight/report/tables.h"

namespace tileflight::report {

struct NamedTable {
  std::string id;
  Table table;
};

/// What a report says of a run, before it stands on a page or in files.
struct Contents {
  std::string name, verdict, remark_on_floor;
  KeyFigures key_figures;
  std::vector<Figure> figures;     ///< those that the run holds data for
  std::vector<NamedTable> tables;  ///< the same
  std::vector<std::string> missing;

  /// By id; an empty one if the run holds nothing for it.
  Figure figure(const std::string& id) const;
  Table table(const std::string& id) const;
};

Contents contents_of(const RunFolder& run);

/// report.json (docs/report.md): all numbers of the page, for programs.
nlohmann::json report_json(const Contents& contents, const nlohmann::json& results);

}  // namespace tileflight::report
