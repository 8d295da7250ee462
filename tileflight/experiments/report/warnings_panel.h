#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/drawing/html.h"

namespace tileflight::report {

/// An entry of `warnings` in results.json.
struct WarningLine {
  std::string message, where, severity, remedy;

  /// Whether the warning prevents a verdict (core/base/warning.h).
  bool forbids_verdict() const { return severity != "note"; }
};

/// Returns the entries of `warnings`: errors, then warnings, then notes, each in their order. Malformed entries are
/// left out.
std::vector<WarningLine> warning_lines(const nlohmann::json& results);

/// Returns "No verdict on whether simulation predicts the surrogate flight's map: …" with the first two warnings that
/// prevent one; empty if none does. `second`: name of the second flight.
std::string withheld_verdict_text(const nlohmann::json& results, const std::string& second);

/// Returns the list of warnings for the top of the page; empty if there are none.
drawing::Html warnings_panel(const nlohmann::json& results);

}  // namespace tileflight::report
