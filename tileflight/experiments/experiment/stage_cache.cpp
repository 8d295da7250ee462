#include "tileflight/experiments/experiment/stage_cache.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/experiments/experiment/folder_cache.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

bool all_exist(const fs::path& folder, const std::vector<std::string>& products) {
  return std::all_of(products.begin(), products.end(), [&](const std::string& p) { return fs::exists(folder / p); });
}

/// stages/a-b.json for "a/b".
fs::path record_path(const fs::path& run_folder, const std::string& name) {
  std::string file = name;
  std::replace(file.begin(), file.end(), '/', '-');
  return run_folder / "stages" / (file + ".json");
}

/// An unreadable record counts as missing: the stage runs again.
nlohmann::json record_in(const fs::path& file) {
  if (!fs::exists(file)) return nullptr;
  return nlohmann::json::parse(base::read_raw(file), nullptr, false);
}

bool is_record_of(const nlohmann::json& record, const std::string& key) {
  return record.is_object() && record.value("key", nlohmann::json()) == key;
}

}  // namespace

StageCache::StageCache(fs::path run_folder, std::string program, fs::path hashes, StageListener listener,
                       fs::path original)
    : run_folder_(std::move(run_folder)),
      program_(std::move(program)),
      hashes_(std::move(hashes)),
      listener_(std::move(listener)),
      original_(std::move(original)) {
  std::error_code fault;
  fs::create_directories(run_folder_ / "stages", fault);
  if (fault) throw InputError((run_folder_ / "stages").string(), "cannot make the folder: " + fault.message());
}

fs::path StageCache::record_file(const std::string& name) const { return record_path(run_folder_, name); }

nlohmann::json StageCache::read_record(const std::string& name) const { return record_in(record_file(name)); }

bool StageCache::take_over(const std::string& name, const std::string& key, const std::vector<std::string>& products) {
  if (original_.empty() || products.empty()) return false;
  const nlohmann::json record = record_in(record_path(original_, name));
  const auto is_folder = [&](const std::string& product) { return fs::is_directory(original_ / product); };
  if (!is_record_of(record, key) || !std::ranges::all_of(products, is_folder)) return false;
  for (const std::string& product : products) {
    fs::create_directories((run_folder_ / product).parent_path());
    const auto marker = base::read_folder_marker(original_ / product);
    const base::OutputFolder output{
        .folder = run_folder_ / product, .command = marker ? marker->command : "run", .replace = true, .inputs = {}};
    base::write_folder(output, [&](const fs::path& temporary) { link_files(original_ / product, temporary); });
  }
  done_[name] = record;
  base::write_file(record_file(name), record.dump(2) + "\n");
  return true;
}

void StageCache::notify(const std::string& stage, StageEvent::Kind what, double seconds) const {
  if (listener_) listener_({stage, what, seconds});
}

bool StageCache::run_stage(const std::string& name, const nlohmann::json& inputs,
                           const std::vector<std::string>& products, const std::function<void()>& work,
                           const std::function<bool()>& take) {
  hashes_.save();  // saved before the work, which may take hours
  const std::string key = base::sha256_hex(program_ + "\n" + inputs.dump());
  const nlohmann::json record = read_record(name);
  if (is_record_of(record, key) && all_exist(run_folder_, products)) {
    done_[name] = record;
    notify(name, StageEvent::Kind::kUnchanged);
    return false;
  }
  std::error_code ignored;
  fs::remove(record_file(name), ignored);
  if (take_over(name, key, products)) {
    notify(name, StageEvent::Kind::kUnchanged);
    return false;
  }

  const auto start = std::chrono::steady_clock::now();
  const bool taken = take && take();
  if (!taken) {
    notify(name, StageEvent::Kind::kBegins);
    work();
    base::return_free_pages();
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  done_[name] = {{"key", key}, {"seconds", seconds}, {"inputs", inputs}, {"products", products}};
  base::write_file(record_file(name), done_[name].dump(2) + "\n");
  notify(name, taken ? StageEvent::Kind::kUnchanged : StageEvent::Kind::kDone, taken ? 0.0 : seconds);
  return !taken;
}

std::string StageCache::key(const std::string& name) const { return done_.at(name).at("key").get<std::string>(); }

std::map<std::string, double> StageCache::seconds() const {
  std::map<std::string, double> result;
  for (const auto& [name, record] : done_) result[name] = record.value("seconds", 0.0);
  return result;
}

std::string StageCache::content_hash(const fs::path& file_or_folder) const {
  return hashes_.hash(file_or_folder, {run_folder_});
}

void invalidate_stages(const fs::path& run_folder) {
  std::error_code error;
  const auto entries_of = [&error](const fs::path& folder) {
    std::vector<fs::path> entries;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
      entries.push_back(entry->path());
    return entries;
  };
  for (const fs::path& record : entries_of(run_folder / "stages")) {
    if (record.extension() == ".json") fs::remove(record, error);
  }
  for (const fs::path& variant : entries_of(run_folder / "variants")) invalidate_stages(variant);
}

}  // namespace tileflight::experiment
