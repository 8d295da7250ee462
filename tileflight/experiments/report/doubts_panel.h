#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/drawing/html.h"

namespace tileflight::report {

/// An entry of `doubts` in results.json.
struct DoubtLine {
  std::string what, where, how_sure, what_to_do;

  /// Whether the doubt prevents a verdict (core/base/doubt.h).
  bool forbids_verdict() const { return how_sure != "possible"; }
};

/// The entries of `doubts`, more certain ones first, otherwise in their order; malformed entries are left out.
std::vector<DoubtLine> doubt_lines(const nlohmann::json& results);

/// "No verdict on whether simulation predicts the surrogate flight's map: …" with the first two doubts that prevent
/// one; empty if none does. `second`: name of the second flight.
std::string withheld_verdict_text(const nlohmann::json& results, const std::string& second);

/// The list of doubts for the top of the page; empty if there are none.
drawing::Html doubts_panel(const nlohmann::json& results);

}  // namespace tileflight::report
