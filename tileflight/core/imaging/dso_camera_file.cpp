// DSO's camera.txt: "MODEL parameters" / "width height" / rectification mode / rectified size. The last two lines are
// for DSO's own rectification to a pinhole, which is not done here: they are checked but not used.
#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"

namespace tileflight::imaging {

namespace {

struct Line {
  int number = 0;
  std::vector<std::string_view> fields;
};

/// The non-empty lines.
std::vector<Line> lines_of(std::string_view text) {
  std::vector<Line> lines;
  for (int number = 1; const auto line = base::take_line(text); ++number) {
    std::vector<std::string_view> fields = base::split_fields(*line);
    if (!fields.empty()) lines.push_back({number, std::move(fields)});
  }
  return lines;
}

std::string line_label(const std::string& file, const Line& line) {
  return file + ": line " + std::to_string(line.number);
}

std::vector<double> numbers_from(const std::string& file, const Line& line, std::size_t first) {
  std::vector<double> values;
  for (std::size_t i = first; i < line.fields.size(); ++i) {
    const auto value = base::parse_number<double>(line.fields[i]);
    if (!value) throw InputError(line_label(file, line), "\"" + std::string(line.fields[i]) + "\" is not a number");
    values.push_back(*value);
  }
  return values;
}

/// Kalibr's name for a lens model of DSO.
std::string dso_distortion(const std::string& file, const Line& line) {
  static const std::map<std::string, std::string, std::less<>> kModels{{"Pinhole", "none"},
                                                                       {"FOV", "fov"},
                                                                       {"RadTan", "radtan"},
                                                                       {"EquiDistant", "equidistant"},
                                                                       {"KannalaBrandt", "equidistant"}};
  const auto model = kModels.find(line.fields.front());
  if (model != kModels.end()) return model->second;
  throw InputError(line_label(file, line), "camera model \"" + std::string(line.fields.front()) +
                                               "\" is unknown: use Pinhole, FOV, RadTan, EquiDistant or KannalaBrandt");
}

struct ModelLine {
  std::string distortion;
  std::vector<double> numbers;  ///< fx fy cx cy and the coefficients
};

/// Parses the first line; without a model name, five numbers are Pinhole (last 0) or FOV and eight are RadTan, as in
/// DSO.
ModelLine read_model(const std::string& file, const Line& line) {
  ModelLine model;
  if (std::isalpha(static_cast<unsigned char>(line.fields.front().front())) != 0 && line.fields.front() != "nan") {
    model.distortion = dso_distortion(file, line);
    model.numbers = numbers_from(file, line, 1);
  } else {
    model.numbers = numbers_from(file, line, 0);
    model.distortion = model.numbers.size() == 8 ? "radtan" : "fov";
    if (model.numbers.size() == 5 && model.numbers[4] == 0.0) model.distortion = "none";
  }
  const std::size_t wanted = model.distortion == "none" || model.distortion == "fov" ? 5 : 8;
  if (model.numbers.size() != wanted)
    throw InputError(line_label(file, line), "this camera model must have " + std::to_string(wanted) +
                                                 " numbers, not " + std::to_string(model.numbers.size()));
  if (model.distortion == "none") {
    if (model.numbers.back() != 0.0) throw InputError(line_label(file, line), "the fifth number of Pinhole must be 0");
    model.numbers.pop_back();
  }
  return model;
}

struct Size {
  int width = 0, height = 0;
};

Size read_dso_size(const std::string& file, const Line& line) {
  if (line.fields.size() == 2) {
    const auto width = base::parse_number<int>(line.fields[0]);
    const auto height = base::parse_number<int>(line.fields[1]);
    if (width && height && *width > 0 && *height > 0) return {*width, *height};
  }
  throw InputError(line_label(file, line), "must be the width and height in pixels");
}

void check_rectification(const std::string& file, const Line& line) {
  const std::string_view word = line.fields.front();
  const bool named = line.fields.size() == 1 && (word == "crop" || word == "full" || word == "none");
  if (named || (line.fields.size() == 5 && numbers_from(file, line, 0).size() == 5)) return;
  throw InputError(line_label(file, line), "must be crop, full, none or the five numbers of a pinhole");
}

/// Converts relative numbers (cx < 1 and cy < 1) to pixels with centres at integers.
void make_absolute(std::vector<double>& k, const Size& size) {
  if (!(k[2] < 1.0 && k[3] < 1.0)) return;
  k[0] *= size.width;
  k[1] *= size.height;
  k[2] = k[2] * size.width - 0.5;
  k[3] = k[3] * size.height - 0.5;
}

std::string coefficients(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) text += " " + format_number(value);
  return text;
}

bool is_plain(const PinholeRadtan& m) { return m.d == std::array<double, 4>{}; }

/// Model name and coefficients of the first line; nullopt if DSO has no name for the lens.
struct NameAndTail {
  std::string name;
  std::string tail;
};
std::optional<NameAndTail> describe(const PinholeRadtan& m) {
  if (is_plain(m)) return NameAndTail{"Pinhole", coefficients({0.0})};
  return NameAndTail{"RadTan", coefficients({m.d[0], m.d[1], m.d[2], m.d[3]})};
}
std::optional<NameAndTail> describe(const KannalaBrandt& m) {
  return NameAndTail{"KannalaBrandt", coefficients({m.k[0], m.k[1], m.k[2], m.k[3]})};
}
std::optional<NameAndTail> describe(const FovModel& m) { return NameAndTail{"FOV", coefficients({m.w})}; }
std::optional<NameAndTail> describe(const DoubleSphere&) { return std::nullopt; }
std::optional<NameAndTail> describe(const UnifiedModel& m) {
  if (m.xi == 0.0) return describe(PinholeRadtan{m.fx, m.fy, m.cx, m.cy, m.d});
  return std::nullopt;
}
std::optional<NameAndTail> describe(const ExtendedUnifiedModel&) { return std::nullopt; }
std::optional<NameAndTail> describe(const PinholeRational& m) {
  if (std::any_of(m.d.begin() + 4, m.d.end(), [](double d) { return d != 0.0; })) return std::nullopt;
  return describe(PinholeRadtan{m.fx, m.fy, m.cx, m.cy, {m.d[0], m.d[1], m.d[2], m.d[3]}});
}
std::optional<NameAndTail> describe(const Equirectangular&) { return std::nullopt; }

std::optional<NameAndTail> describe(const Camera& camera) {
  return std::visit([](const auto& m) { return describe(m); }, camera.model());
}

/// fx fy cx cy in the form that DSO reads back: it takes a principal point below pixel 1 as relative, so relative
/// numbers are written then.
template <class Model>
std::string focal_of(const Model& m, int width, int height) {
  if (m.cx < 1.0 && m.cy < 1.0)
    return coefficients({m.fx / width, m.fy / height, (m.cx + 0.5) / width, (m.cy + 0.5) / height});
  return coefficients({m.fx, m.fy, m.cx, m.cy});
}

}  // namespace

Calibration read_dso_camera(const std::filesystem::path& file) {
  const std::string name = file.string();
  const std::string text = base::read_text(file, kMaxCalibrationBytes);
  const std::vector<Line> lines = lines_of(text);
  if (lines.size() < 2) throw InputError(name, "must have a line with the camera model and one with the image size");
  ModelLine model = read_model(name, lines[0]);
  const Size size = read_dso_size(name, lines[1]);
  if (lines.size() > 2) check_rectification(name, lines[2]);
  if (lines.size() > 3) read_dso_size(name, lines[3]);
  make_absolute(model.numbers, size);
  const std::span<const double> numbers = model.numbers;
  Calibration calibration;
  calibration.camera =
      make_camera(name, {model.distortion, numbers.first(4), numbers.subspan(4), size.width, size.height});
  return calibration;
}

bool has_dso_model(const Camera& camera) { return describe(camera).has_value(); }

void write_dso_camera(const std::filesystem::path& file, const Calibration& calibration) {
  const Camera& camera = calibration.camera;
  const std::optional<NameAndTail> lens = describe(camera);
  if (!lens)
    throw InputError(file.string(),
                     "DSO's camera file cannot describe this lens: write a Kalibr camchain (.yaml) instead");
  const std::string size = std::to_string(camera.width()) + " " + std::to_string(camera.height()) + "\n";
  const std::string focal =
      std::visit([&](const auto& m) { return focal_of(m, camera.width(), camera.height()); }, camera.model());
  const char* rectification = lens->name == "Pinhole" ? "none\n" : "crop\n";
  base::write_file(file, lens->name + focal + lens->tail + "\n" + size + rectification + size);
}

}  // namespace tileflight::imaging
