#include "tileflight/capture/flight_path/smoothing.h"

#include <iomanip>
#include <sstream>

#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::flight_path {

std::optional<SmoothingOptions> read_smoothing(base::StrictSection& section,
                                               const std::optional<SmoothingOptions>& fallback) {
  const std::optional<std::string> text = section.text("smooth");
  if (!text) return fallback;
  if (*text == "none") return std::nullopt;
  if (*text == "auto") return SmoothingOptions{};
  const std::optional<double> spacing_s = base::parse_finite_number(*text);
  if (!spacing_s || *spacing_s <= 0.0)
    throw section.error("smooth", "must be 'auto', 'none' or the seconds between two knots");
  return SmoothingOptions{.knot_spacing_s = spacing_s};
}

std::string smoothing_text(const std::optional<SmoothingOptions>& smoothing) {
  if (!smoothing) return "none";
  if (!smoothing->knot_spacing_s) return "auto";
  std::ostringstream text;
  text << std::setprecision(17) << *smoothing->knot_spacing_s;
  return text.str();
}

}  // namespace tileflight::flight_path
