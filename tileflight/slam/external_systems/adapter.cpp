#include "tileflight/slam/external_systems/adapter.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <utility>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/jobs/process.h"
#include "tileflight/data/exports/export_dataset.h"
#include "tileflight/slam/external_systems/lens_support.h"

namespace tileflight::external_systems {
namespace fs = std::filesystem;
namespace {

using base::StrictSection;

constexpr std::array<std::pair<const char*, Input>, 5> kInputWords{{{"images", Input::kImages},
                                                                    {"stereo", Input::kStereo},
                                                                    {"depth", Input::kDepth},
                                                                    {"imu", Input::kImu},
                                                                    {"lidar", Input::kLidar}}};
constexpr const char* kManifest = "adapter.yaml";
/// The dataset folder as it is, without conversion.
constexpr const char* kUnconverted = "tileflight";

std::vector<std::string> separated(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) {
    if (!part.empty()) parts.push_back(part);
  }
  return parts;
}

std::vector<Input> read_inputs(StrictSection& section) {
  std::vector<Input> inputs;
  for (const std::string& word : section.required_texts("inputs")) {
    const auto known = std::ranges::find_if(kInputWords, [&](const auto& pair) { return word == pair.first; });
    if (known == kInputWords.end())
      throw section.error("inputs", "has '" + word + "'; there are images, stereo, depth, imu and lidar");
    inputs.push_back(known->second);
  }
  if (inputs.empty()) throw section.error("inputs", "is empty: list what the system reads, e.g. [images, imu]");
  return inputs;
}

std::vector<std::string> read_lenses(StrictSection& section) {
  const std::vector<std::string> lenses = section.required_texts("lenses");
  for (const std::string& word : lenses) {
    if (word != "any" && !std::ranges::count(lens_names(), word))
      throw section.error("lenses", "has '" + word + "', which is no lens" + base::did_you_mean(word, lens_names()));
  }
  if (lenses.empty()) throw section.error("lenses", "is empty: list the lenses that the system knows, or [any]");
  return lenses;
}

void read_takes(StrictSection section, Adapter& adapter) {
  adapter.inputs = read_inputs(section);
  adapter.lenses = read_lenses(section);
  std::vector<std::string> layouts = exports::export_layouts();
  layouts.emplace_back(kUnconverted);
  adapter.layout = section.choice("layout", layouts).value_or(kUnconverted);
  section.require_all_keys_used();
}

void read_needs(StrictSection section, Adapter& adapter) {
  section.ignore({"programs", "variables"});  // keys here, also where they are left out
  if (section.has("programs")) adapter.programs = section.required_texts("programs");
  if (section.has("variables")) adapter.variables = section.required_texts("variables");
  adapter.needs_gpu = section.boolean("gpu").value_or(false);
  section.require_all_keys_used();
}

void read_leaves(StrictSection section, Adapter& adapter) {
  if (auto path = section.section("trajectory")) {
    PathConvention& convention = adapter.path;
    convention.file = path->text("file").value_or(convention.file);
    convention.is_colmap_model = path->choice("format", {"poses", "colmap"}).value_or("poses") == "colmap";
    convention.camera_to_world =
        path->choice("pose", {"camera-to-world", "world-to-camera"}).value_or("camera-to-world") == "camera-to-world";
    convention.of = path->choice("of", {"camera", "imu", "lidar"}).value_or(convention.of);
    convention.times = path->choice("times", {"seconds", "nanoseconds", "frame-indices"}).value_or(convention.times);
    path->require_all_keys_used();
  }
  adapter.map = section.text("map").value_or("");
  adapter.metric_scale = section.choice("scale", {"metric", "unknown"}).value_or("unknown") == "metric";
  section.require_all_keys_used();
}

bool is_name(const std::string& text) {
  return !text.empty() &&
         std::ranges::all_of(text, [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; });
}

void replace_all(std::string& text, const std::string& name, const std::string& value) {
  for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name, at + value.size()))
    text.replace(at, name.size(), value);
}

bool is_in_path(const std::string& program) {
  const char* path = std::getenv("PATH");
  for (const std::string& folder : separated(path == nullptr ? "" : path, ':')) {
    if (access((fs::path(folder) / program).c_str(), X_OK) == 0) return true;
  }
  return false;
}

}  // namespace

std::string to_text(Input input) {
  return std::ranges::find(kInputWords, input, [](const auto& pair) { return pair.second; })->first;
}

Adapter read_adapter(const fs::path& folder) {
  StrictSection root = StrictSection::load(folder / kManifest);
  Adapter adapter;
  adapter.folder = fs::absolute(folder).lexically_normal();
  adapter.name = root.required_text("name");
  if (!is_name(adapter.name)) throw root.error("name", "may hold letters, digits, '-' and '_' only");
  adapter.title = root.text("title").value_or(adapter.name);
  adapter.homepage = root.text("homepage").value_or("");
  adapter.licence = root.text("licence").value_or("");
  adapter.tried = root.text("tried").value_or("");
  read_takes(root.required_section("takes"), adapter);
  if (auto needs = root.section("needs")) read_needs(*needs, adapter);
  adapter.version_command = root.text("version").value_or("");
  adapter.command = root.text("command").value_or("./run");
  if (auto leaves = root.section("leaves")) read_leaves(*leaves, adapter);
  root.require_all_keys_used();
  return adapter;
}

Adapter command_adapter(std::string command, const fs::path& folder) {
  replace_all(command, "{dataset}", "\"$DATASET\"");
  replace_all(command, "{out}", "\"$OUT\"");
  Adapter adapter;
  adapter.folder = folder;
  adapter.name = "command";
  adapter.title = "the command";
  adapter.lenses = {"any"};
  adapter.inputs = {Input::kImages};
  adapter.layout = kUnconverted;
  adapter.command = std::move(command);
  adapter.map = "map.ply";
  return adapter;
}

std::vector<fs::path> adapter_folders() {
  const char* own = std::getenv("TILEFLIGHT_ADAPTERS");
  std::vector<fs::path> folders;
  for (const std::string& folder : separated(own == nullptr ? "" : own, ':')) folders.emplace_back(folder);
  folders.emplace_back("adapters");
  if (const fs::path program = base::program_path().parent_path(); !program.empty()) {
    folders.push_back(base::data_folder() / "adapters");                                // PREFIX/bin
    folders.push_back(program.parent_path().parent_path().parent_path() / "adapters");  // build/PRESET/bin
  }
  return folders;
}

std::vector<Adapter> list_adapters() {
  std::vector<Adapter> adapters;
  std::set<std::string> names;
  for (const fs::path& folder : adapter_folders()) {
    if (!fs::is_directory(folder)) continue;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      if (!fs::exists(entry.path() / kManifest)) continue;
      Adapter adapter = read_adapter(entry.path());
      if (names.insert(adapter.name).second) adapters.push_back(std::move(adapter));
    }
  }
  std::ranges::sort(adapters, {}, &Adapter::name);
  return adapters;
}

Adapter find_adapter(const std::string& name_or_folder, const fs::path& base) {
  if (const fs::path folder = base / name_or_folder; fs::exists(folder / kManifest)) return read_adapter(folder);
  std::vector<std::string> names;
  for (Adapter& adapter : list_adapters()) {
    if (adapter.name == name_or_folder) return adapter;
    names.push_back(adapter.name);
  }
  const std::string meant = base::did_you_mean(name_or_folder, names);
  throw InputError("system '" + name_or_folder + "'",
                   "has no adapter" + (meant.empty() ? "; `tileflight systems` lists those there are" : meant));
}

std::string why_not_installed(const Adapter& adapter) {
  for (const std::string& program : adapter.programs) {
    if (!is_in_path(program)) return "the program '" + program + "' is not in PATH";
  }
  for (const std::string& variable : adapter.variables) {
    const char* value = std::getenv(variable.c_str());
    if (value == nullptr || *value == '\0') return "the environment variable " + variable + " is not set";
    if (!fs::exists(value)) return variable + " names " + value + ", which does not exist";
  }
  if (adapter.needs_gpu && !fs::exists("/dev/nvidiactl")) return "this machine has no NVIDIA graphics processor";
  return "";
}

void require_installed(const Adapter& adapter) {
  const std::string missing = why_not_installed(adapter);
  if (!missing.empty())
    throw InputError(adapter.title, "is not installed: " + missing + "; `tileflight systems` says which systems are");
}

std::string installed_version(const Adapter& adapter) {
  if (adapter.version_command.empty() || !why_not_installed(adapter).empty()) return "";
  std::map<std::string, std::string> environment;
  if (const fs::path program = base::program_path(); !program.empty() && std::getenv("TILEFLIGHT") == nullptr)
    environment["TILEFLIGHT"] = program.string();
  const fs::path log = base::make_temporary_path(fs::temp_directory_path() / "tileflight-version");
  const base::RemovedOnExit removal(log);
  jobs::run_guarded({.words = jobs::shell("(" + adapter.version_command + ") 2>/dev/null"),
                     .log = log,
                     .environment = std::move(environment)});
  std::string version;
  std::ifstream lines(log);
  std::getline(lines, version);
  while (!version.empty() && std::isspace(static_cast<unsigned char>(version.back())) != 0) version.pop_back();
  return version;
}

}  // namespace tileflight::external_systems
