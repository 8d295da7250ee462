#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/report/html.h"

namespace tileflight::report {

/// One of `doubts` of results.json.
struct DoubtLine {
  std::string what, where, how_sure, what_to_do;

  /// Whether a verdict is withheld because of it (geometry/doubt.h).
  bool forbids_verdict() const { return how_sure != "possible"; }
};

/// The surer first, else in their order; what is no doubt is left out.
std::vector<DoubtLine> doubt_lines(const nlohmann::json& results);

/// "No verdict on whether simulation predicts the surrogate flight's map: …": what forbids one, the first two of them;
/// empty where nothing does.
std::string verdict_withheld(const nlohmann::json& results, const std::string& second);

/// The list for the page's first screen; nothing where there is no doubt.
Html doubts_panel(const nlohmann::json& results);

}  // namespace tileflight::report
