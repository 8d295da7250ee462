#include "tileflight/experiment/stage_cache.h"

#include <algorithm>
#include <chrono>

#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

std::string folder_fingerprint(const fs::path& folder) {
  std::vector<std::string> lines;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    const auto modified = entry.last_write_time().time_since_epoch().count();
    lines.push_back(fs::relative(entry.path(), folder).string() + " " + std::to_string(entry.file_size()) + " " +
                    std::to_string(modified));
  }
  std::sort(lines.begin(), lines.end());
  std::string list;
  for (const std::string& line : lines) list += line + "\n";
  return geometry::sha256_hex(list);
}

bool all_exist(const fs::path& folder, const std::vector<std::string>& products) {
  return std::all_of(products.begin(), products.end(), [&](const std::string& p) { return fs::exists(folder / p); });
}

}  // namespace

std::string fingerprint(const fs::path& file_or_folder) {
  try {
    if (fs::is_directory(file_or_folder)) return folder_fingerprint(file_or_folder);
  } catch (const fs::filesystem_error& fault) {
    throw InputError(file_or_folder.string(), fault.code().message());
  }
  if (!fs::exists(file_or_folder)) throw InputError(file_or_folder.string(), "no such file or folder");
  return geometry::sha256_hex_of_file(file_or_folder);
}

std::string program_fingerprint() { return geometry::sha256_hex_of_file("/proc/self/exe"); }

StageCache::StageCache(fs::path run_folder, std::string program)
    : run_folder_(std::move(run_folder)), program_(std::move(program)) {
  std::error_code fault;
  fs::create_directories(run_folder_ / "stages", fault);
  if (fault) throw InputError((run_folder_ / "stages").string(), "cannot make the folder: " + fault.message());
}

fs::path StageCache::record_file(const std::string& name) const {
  std::string file = name;
  std::replace(file.begin(), file.end(), '/', '-');
  return run_folder_ / "stages" / (file + ".json");
}

nlohmann::json StageCache::read_record(const std::string& name) const {
  const fs::path file = record_file(name);
  if (!fs::exists(file)) return nullptr;
  // A record that cannot be read is as good as none: the stage is done again.
  return nlohmann::json::parse(geometry::read_text(file), nullptr, false);
}

bool StageCache::once(const std::string& name, const nlohmann::json& inputs, const std::vector<std::string>& products,
                      const std::function<void()>& work) {
  const std::string key = geometry::sha256_hex(program_ + "\n" + inputs.dump());
  const nlohmann::json record = read_record(name);
  if (record.is_object() && record.value("key", "") == key && all_exist(run_folder_, products)) {
    done_[name] = record;
    return false;
  }
  std::error_code ignored;
  fs::remove(record_file(name), ignored);
  for (const std::string& product : products) fs::remove_all(run_folder_ / product, ignored);

  const auto start = std::chrono::steady_clock::now();
  work();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  done_[name] = {{"key", key}, {"seconds", seconds}, {"inputs", inputs}, {"products", products}};
  geometry::write_file(record_file(name), done_[name].dump(2) + "\n");
  return true;
}

std::string StageCache::key(const std::string& name) const { return done_.at(name).at("key").get<std::string>(); }

std::map<std::string, double> StageCache::seconds() const {
  std::map<std::string, double> result;
  for (const auto& [name, record] : done_) result[name] = record.value("seconds", 0.0);
  return result;
}

}  // namespace tileflight::experiment
