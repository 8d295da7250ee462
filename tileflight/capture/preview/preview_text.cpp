#include "tileflight/capture/preview/preview_text.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"

namespace tileflight::preview {

using nlohmann::json;

std::string preview_text(const json& found, const fs::path& out) {
  const auto about = [](double seconds) {
    if (seconds < 90) return base::formatted("%.0f s", std::max(1.0, seconds));
    return seconds < 5400 ? base::formatted("%.0f min", seconds / 60) : base::formatted("%.1f h", seconds / 3600);
  };
  std::string text =
      out.string() + ": " + std::to_string(found["frames"].get<int>()) + " frames in " +
      base::formatted("%.1f s over %.1f m", found["duration_s"].get<double>(), found["path_length"].get<double>());
  const auto range = [&](const char* key, const char* words) {
    if (found[key].is_null()) return;
    text += base::formatted("\n%s: %.1f to %.1f m", words, found[key]["min"].get<double>(),
                            found[key]["max"].get<double>());
  };
  range("height_above_ground", "height above the surface below");
  if (const json& nearest = found["nearest_surface"]; !nearest.is_null())
    text += base::formatted("; nearest surface %.2f m at frame %d", nearest["distance"].get<double>(),
                            nearest["frame"].get<int>());
  const json& cost = found["cost"];
  text += base::formatted("\nrendering: %.3g million pixels from %d tiles", cost["pixels"].get<double>() / 1e6,
                          cost["tiles"].get<int>());
  if (!cost["bytes"].is_null()) text += base::formatted(" (%.1f MB)", cost["bytes"].get<double>() / 1e6);
  text += base::formatted(", about %.2f GB of memory and about ", cost["memory_bytes"].get<double>() / 1e9) +
          about(cost["seconds"]["total"]) + base::formatted(" with %d threads\n", cost["threads"].get<int>());
  for (const auto& warning : found["warnings"]) text += "warning: " + warning.get<std::string>() + "\n";
  if (found["warnings"].empty()) text += "no problems found\n";
  return text;
}

}  // namespace tileflight::preview
