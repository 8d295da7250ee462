#include "tileflight/evaluation/scoring/path_warnings.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"

namespace tileflight::scoring {

void answer_path_warnings(const MapInputs& map, const registration::PictureAgreement& pictures, Warnings& warnings) {
  constexpr double kPathShare = 0.005;
  constexpr std::size_t kFewest = 10;
  const bool is_measured = pictures.tried >= kFewest && 10 * pictures.located >= 9 * pictures.tried;
  if (!is_measured || !(pictures.path_error_m <= kPathShare * pictures.path_length_m)) return;
  const std::filesystem::path file = map.map / "odometry.json";
  if (std::error_code none; !std::filesystem::exists(file, none)) return;
  const nlohmann::json about = nlohmann::json::parse(base::read_text(file), nullptr, false);
  const nlohmann::json path =
      about.is_object() ? about.value("path_warnings", nlohmann::json::array()) : nlohmann::json::array();
  for (Warning& warning : warnings) {
    if (warning.severity != Severity::kWarning ||
        std::ranges::find(path, nlohmann::json(warning.message)) == path.end())
      continue;
    warning.severity = Severity::kNote;
    warning.remedy = base::formatted(
        "nothing, if the place is as it was: %zu of %zu images, located in it, differ by %.2g %% of the path's length",
        pictures.located, pictures.tried, 100.0 * pictures.path_error_m / pictures.path_length_m);
  }
}

}  // namespace tileflight::scoring
