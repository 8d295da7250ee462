#include "tileflight/tiles/mesh_files/mtl_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::mesh_files {
namespace {

/// Takes a number from the front of `line`.
bool take_number(std::string_view& line, float& value) {
  std::string_view rest = line;
  const auto number = base::parse_number<float>(base::take_field(rest));
  if (!number || !std::isfinite(*number)) return false;
  value = *number;
  line = rest;
  return true;
}

/// Reads up to three numbers, of which the first two are used.
void take_pair(std::string_view& line, std::array<float, 2>& pair) {
  float third = 0;
  if (take_number(line, pair[0]) && take_number(line, pair[1])) take_number(line, third);
}

/// Number of arguments of a texture map option.
int argument_count(std::string_view option) {
  if (option == "-mm") return 2;
  return 1;
}

/// Options precede the file name, which is the rest of the line.
void read_map(std::string_view line, MtlMaterial& material) {
  line = base::trim(line);
  while (line.starts_with('-')) {
    std::string_view rest = line;
    const std::string_view option = base::take_field(rest);
    if (option == "-s") {
      take_pair(rest, material.scale);
    } else if (option == "-o") {
      take_pair(rest, material.offset);
    } else if (option == "-t") {
      std::array<float, 2> turbulence{};
      take_pair(rest, turbulence);
    } else if (option == "-clamp") {
      material.clamp = base::take_field(rest) == "on";
    } else {
      for (int i = 0; i < argument_count(option); ++i) base::take_field(rest);
    }
    line = base::trim(rest);
  }
  material.texture = std::string(line);
}

/// `r g b`, or one number for a grey.
void read_color(std::string_view line, const std::string& where, MtlMaterial& material) {
  auto& [r, g, b] = material.color;
  if (!take_number(line, r)) throw InputError(where, "Kd needs one or three numbers");
  if (base::trim(line).empty()) {
    g = b = r;
  } else if (!take_number(line, g) || !take_number(line, b)) {
    throw InputError(where, "Kd needs one or three numbers");
  }
  for (float& value : material.color) value = std::clamp(value, 0.0F, 1.0F);
}

}  // namespace

std::map<std::string, MtlMaterial> parse_mtl(std::string_view text, const std::string& name) {
  std::map<std::string, MtlMaterial> out;
  MtlMaterial* material = nullptr;
  std::int64_t line_number = 0;
  while (auto line = base::take_line(text)) {
    const std::string where = name + ", line " + std::to_string(++line_number);
    const std::string_view key = base::take_field(*line);
    if (key == "newmtl") material = &out[std::string(base::trim(*line))];
    if (material == nullptr) continue;
    if (key == "Kd" && !base::trim(*line).starts_with("spectral") && !base::trim(*line).starts_with("xyz"))
      read_color(*line, where, *material);
    if (key == "map_Kd" || key == "map_kd") read_map(*line, *material);
  }
  return out;
}

}  // namespace tileflight::mesh_files
