#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/drawing/drawing.h"
#include "tileflight/experiments/report/key_figures.h"
#include "tileflight/experiments/report/run_folder.h"
#include "tileflight/experiments/report/tables.h"

namespace tileflight::report {

/// A table with its id.
struct NamedTable {
  std::string id;
  Table table;
};

/// Content of a report, independent of whether it is put on a page or in files.
struct ReportContents {
  std::string name, verdict, remark_on_floor;
  KeyFigures key_figures;
  std::vector<drawing::Figure> figures;  ///< only those with data
  std::vector<NamedTable> tables;        ///< only those with data
  std::vector<std::string> missing;

  /// The figure or table with this id; empty if the run has no data for it.
  drawing::Figure figure(const std::string& id) const;
  Table table(const std::string& id) const;
};

/// Builds all figures, tables and texts of a run.
ReportContents build_contents(const RunFolder& run);

/// report.json (docs/report.md): all numbers of the page in machine-readable form.
nlohmann::json report_json(const ReportContents& contents, const nlohmann::json& results);

}  // namespace tileflight::report
