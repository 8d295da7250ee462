#include "tileflight/live/simulator/prepared_scenes.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

namespace tileflight::simulator {
namespace {

/// Scenes that are made ahead (sensors cross a border one after the other, so there are two for each cell on a way),
/// and those kept beside the present one. They share most of their tiles, and memory limits them, too; so many are kept
/// that a vehicle that circles makes none twice.
constexpr std::size_t kScenesAhead = 3, kScenesKept = 32;

/// Memory of the scene's tiles that were not counted before.
std::uintmax_t count_bytes(const ResidentScene& scene, std::set<const ResidentPart*>& counted) {
  std::uintmax_t bytes = 0;
  bool has_parts = false;  // a region that is loaded whole is one part for all its tiles
  for (const ResidentTile& tile : scene.tiles()) {
    has_parts = has_parts || tile.part;
    bytes += tile.part && counted.insert(tile.part.get()).second ? tile.part->bytes() : 0;
  }
  return has_parts ? bytes : scene.loaded().bytes;
}

}  // namespace

std::optional<TileKey> key_of(const tileset::CutContent& content) { return TileKey{content.node, content.content}; }

std::shared_ptr<const ResidentScene> PreparedScenes::current() const {
  const std::lock_guard lock(mutex_);
  return present_ ? present_->scene : nullptr;
}

DetailLimit PreparedScenes::detail() const {
  const std::lock_guard lock(mutex_);
  return detail_;
}

std::uintmax_t PreparedScenes::memory_bytes() const {
  const std::lock_guard lock(mutex_);
  std::set<const ResidentPart*> counted;
  std::uintmax_t bytes = present_ ? count_bytes(*present_->scene, counted) : 0;
  for (const PreparedScene& other : others_) bytes += count_bytes(*other.scene, counted);
  return bytes;
}

void PreparedScenes::count_pin_change() {
  const std::lock_guard lock(mutex_);
  ++pins_;
}

std::uint64_t PreparedScenes::pins() const {
  const std::lock_guard lock(mutex_);
  return pins_;
}

/// Returns whether a scene was made for these cells and the regions that are pinned now; requires the mutex.
bool PreparedScenes::serves(const PreparedScene& one, const SensorCells& cells) const {
  return one.cells == cells && one.pins == pins_;
}

std::optional<PreparedScenes::Entered> PreparedScenes::enter(const SensorCells& cells,
                                                             std::chrono::milliseconds retry_after) {
  const std::lock_guard lock(mutex_);
  if (!present_ || !serves(*present_, cells)) {
    const auto at = std::ranges::find_if(
        others_, [&](const PreparedScene& other) { return serves(other, cells) && other.wanted == detail_; });
    if (at == others_.end()) return std::nullopt;
    PreparedScene left = std::move(*present_);
    present_ = std::move(*at);
    others_.erase(at);
    others_.push_front(std::move(left));
  }
  const bool may_retry = std::chrono::steady_clock::now() - last_failure_ >= retry_after;
  if (present_->scene->loaded().tiles_failed > 0 && may_retry) return std::nullopt;
  const DetailLimit before = detail_;
  detail_ = present_->wanted = present_->detail;  // a search that begins there ends there
  return Entered{present_->scene, before, detail_, present_->worst_px};
}

PreparedScenes::Entered PreparedScenes::enter(PreparedScene next) {
  std::list<PreparedScene> gone;  // freed without the lock
  const std::lock_guard lock(mutex_);
  const DetailLimit before = detail_;
  for (auto at = others_.begin(); at != others_.end();) {
    const auto other = at++;
    if (other->cells == next.cells) gone.splice(gone.end(), others_, other);
  }
  if (present_) {
    std::list<PreparedScene>& to = present_->cells == next.cells ? gone : others_;
    to.push_front(std::move(*present_));
  }
  present_ = std::move(next);
  detail_ = present_->wanted = present_->detail;  // a search that begins there ends there
  return {present_->scene, before, detail_, present_->worst_px};
}

void PreparedScenes::add(PreparedScene ahead) {
  const std::lock_guard lock(mutex_);
  others_.push_front(std::move(ahead));
}

void PreparedScenes::note_failure() {
  const std::lock_guard lock(mutex_);
  last_failure_ = std::chrono::steady_clock::now();
}

bool PreparedScenes::holds(const SensorCells& cells) const {
  const std::lock_guard lock(mutex_);
  return (present_ && serves(*present_, cells)) || std::ranges::any_of(others_, [&](const PreparedScene& one) {
           return serves(one, cells) && one.wanted == detail_;
         });
}

std::shared_ptr<const ResidentScene> PreparedScenes::find_same(const tileset::TileCut& cut) const {
  const std::lock_guard lock(mutex_);
  const auto is_same = [&](const PreparedScene& one) {
    return one.scene->loaded().tiles_failed == 0 &&
           std::ranges::equal(cut.contents, one.scene->tiles(), {}, key_of, &ResidentTile::key);
  };
  if (present_ && is_same(*present_)) return present_->scene;
  const auto at = std::ranges::find_if(others_, is_same);
  return at == others_.end() ? nullptr : at->scene;
}

bool PreparedScenes::make_room(const SensorCells* ahead,
                               std::span<const std::shared_ptr<const ResidentPart>> in_the_making,
                               std::uintmax_t max_memory_bytes) {
  std::list<PreparedScene> gone;  // freed without the lock
  const std::lock_guard lock(mutex_);
  const auto rank = [&](const SensorCells& cells) { return std::ranges::find(ahead_, cells) - ahead_.begin(); };
  others_.sort([&](const PreparedScene& a, const PreparedScene& b) { return rank(a.cells) < rank(b.cells); });
  const auto first_after = std::ranges::find_if(
      others_, [&](const PreparedScene& other) { return ahead == nullptr || rank(other.cells) >= rank(*ahead); });
  std::set<const ResidentPart*> counted;
  std::uintmax_t bytes = present_ ? count_bytes(*present_->scene, counted) : 0;
  for (auto at = others_.begin(); at != first_after; ++at) bytes += count_bytes(*at->scene, counted);
  for (const auto& part : in_the_making) bytes += counted.insert(part.get()).second ? part->bytes() : 0;
  if (ahead != nullptr && bytes > max_memory_bytes) return false;
  auto kept = static_cast<std::size_t>(std::distance(others_.begin(), first_after));
  auto at = first_after;
  for (; at != others_.end(); ++at) {
    bytes += count_bytes(*at->scene, counted);
    if (++kept > kScenesKept || bytes > max_memory_bytes) break;
  }
  gone.splice(gone.end(), others_, at, others_.end());
  return true;
}

void PreparedScenes::plan(std::span<const SensorViewpoint> viewpoints) {
  {
    const std::lock_guard lock(mutex_);
    std::optional<std::vector<SensorCells>> next = motion_.predict(viewpoints, kScenesAhead);
    if (!next || *next == ahead_) return;
    ahead_ = std::move(*next);
    is_planned_ = true;
  }
  wake_.notify_all();
}

bool PreparedScenes::is_ahead(const SensorCells& cells) const {
  const std::lock_guard lock(mutex_);
  return std::ranges::find(ahead_, cells) != ahead_.end();
}

std::optional<std::vector<SensorCells>> PreparedScenes::wait_for_plan(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  is_preparing_ = false;
  wake_.notify_all();
  if (!wake_.wait(lock, stop, [this] { return is_planned_; })) return std::nullopt;
  is_planned_ = false;
  is_preparing_ = true;
  return ahead_;
}

void PreparedScenes::wait_until_prepared() {
  std::unique_lock lock(mutex_);
  wake_.wait(lock, [this] { return !is_planned_ && !is_preparing_; });
}

}  // namespace tileflight::simulator
