#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/live/simulator/resident_scene.h"

namespace tileflight::simulator {

/// An object spawned by a client.
struct WorldObject {
  std::string name;
  std::string asset;
  std::shared_ptr<const ResidentPart> part;       ///< x forward, y left, z up
  geometry::SE3 T_ned_object;                     ///< of its axes x forward, y right, z down, in global NED
  geometry::Vec3 scale = geometry::Vec3::Ones();  ///< along these axes
};

/// The objects at one time, in the order in which they were spawned. Never null.
using ObjectList = std::shared_ptr<const std::vector<WorldObject>>;

/// Files of the user that clients may spawn, by the name of the asset.
using AssetFiles = std::map<std::string, std::filesystem::path>;

/// The objects that clients spawn, move and destroy, beside the tiles. Thread-safe; each change makes a new list, so
/// that each picture and each scan sees the objects at one instant.
class WorldObjects {
 public:
  static constexpr std::size_t kMaxObjects = 1000;

  /// Reads the files (mesh_files::read_mesh_source). A glTF model's front (+Z) becomes the object's x. Throws
  /// InputError: a file that cannot be read, a name that is empty or too long.
  explicit WorldObjects(const AssetFiles& files);

  /// Returns the names of the assets, sorted: AirSim's for shapes, own models, the user's files.
  std::vector<std::string> assets() const;
  ObjectList now() const;
  std::optional<WorldObject> find(const std::string& name) const;

  /// Adds an object. `of_tiles`: the names of the tiles' objects; as in AirSim, a name that another one contains gets a
  /// number. Returns its name. Throws InputError: an unknown asset, a wrong name or scale, too many objects.
  std::string spawn(const std::string& name, const std::string& asset, const geometry::SE3& T_ned_object,
                    const geometry::Vec3& scale, const std::vector<std::string>& of_tiles);
  // These return false if there is no such object.
  bool destroy(const std::string& name);
  bool move(const std::string& name, const geometry::SE3& T_ned_object);
  bool rescale(const std::string& name, const geometry::Vec3& scale);  ///< throws InputError for a wrong scale

  /// Returns the place with the objects, or the place itself if there are none. The latest result is cached.
  std::shared_ptr<const ResidentScene> populate(const std::shared_ptr<const ResidentScene>& place,
                                                const ObjectList& objects, const geometry::SE3& T_local_ned);

 private:
  template <class Change>
  bool change(const std::string& name, const Change& change);

  scene::SceneFrame frame_;  ///< of all models
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const ResidentPart>> parts_;  ///< by asset; of built-in ones null until spawned
  ObjectList objects_ = std::make_shared<const std::vector<WorldObject>>();
  struct Populated {
    std::shared_ptr<const ResidentScene> place, result;
    ObjectList objects;
  };
  Populated latest_;
};

/// Computes the pose of an object's part: p_local = pose * p_part.
Eigen::Affine3d local_pose(const WorldObject& object, const geometry::SE3& T_local_ned);

}  // namespace tileflight::simulator
