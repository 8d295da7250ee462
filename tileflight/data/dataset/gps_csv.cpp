#include <array>
#include <cmath>
#include <string_view>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset {

namespace {

constexpr std::string_view kGpsHeader = "t,lat,lon,height,horizontal_sigma,vertical_sigma";
constexpr std::size_t kGpsColumns = 6;

GpsFix parse_fix(const std::string& where, const std::vector<std::string_view>& fields) {
  if (fields.size() != kGpsColumns)
    throw InputError(where,
                     "expected 6 numbers (" + std::string(kGpsHeader) + "), found " + std::to_string(fields.size()));
  std::array<double, kGpsColumns> v{};
  for (std::size_t i = 0; i < kGpsColumns; ++i) v[i] = base::require_finite(where, fields[i]);
  if (std::abs(v[1]) > 90.0 || std::abs(v[2]) > 360.0) throw InputError(where, "latitude or longitude is out of range");
  if (v[4] < 0.0 || v[5] < 0.0) throw InputError(where, "a standard deviation is negative");
  return {v[0], {v[1], v[2], {v[3]}}, v[4], v[5]};
}

}  // namespace

std::vector<GpsFix> read_gps_csv(const std::filesystem::path& file) {
  std::vector<GpsFix> fixes;
  base::for_each_row(base::read_text(file), file.string(), ", \t", [&](const base::TextRow& row) {
    if (row.line == 1 && !base::parse_number<double>(row.fields.front())) return;  // the header
    fixes.push_back(parse_fix(row.where, row.fields));
    if (fixes.size() > 1 && !(fixes.back().time_s > fixes[fixes.size() - 2].time_s))
      throw InputError(row.where, "the time is not after the one before it");
  });
  return fixes;
}

void write_gps_csv(const std::filesystem::path& file, const std::vector<GpsFix>& fixes) {
  std::string text = std::string(kGpsHeader) + "\n";
  for (const GpsFix& fix : fixes) {
    text += base::fixed_text(fix.time_s) + "," + base::fixed_text(fix.position.latitude_deg) + "," +
            base::fixed_text(fix.position.longitude_deg) + "," + base::fixed_text(fix.position.height.m) + "," +
            base::fixed_text(fix.horizontal_sigma_m) + "," + base::fixed_text(fix.vertical_sigma_m) + "\n";
  }
  base::write_file(file, text);
}

}  // namespace tileflight::dataset
