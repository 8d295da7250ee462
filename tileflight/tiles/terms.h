#pragma once

#include <string>
#include <vector>

namespace tileflight::tiles {

/// What may be done with tiles, beyond looking at where they are.
enum class Use {
  kAnalyse,  ///< let a machine read pictures of them (odometry, a dataset for it)
  kExtract,  ///< take geometry out of them (ground truth)
  kCache,    ///< keep them on disk as far as HTTP allows
  kOffline,  ///< use kept ones without asking the server
};

/// A use that a provider's terms forbid, unless the user's own agreement says otherwise.
struct ForbiddenUse {
  Use use;
  std::string says;  ///< the term in a few words
  std::string url;   ///< where it can be read
};

/// What a source permits. Terms that forbid nothing here are not a licence: they are what is known.
struct Terms {
  std::string provider;  ///< "files", "example.org", "Google Photorealistic 3D Tiles", "Cesium ion"
  std::string url;       ///< of the terms; empty: not known, ask the provider
  std::vector<ForbiddenUse> forbidden;

  /// nullptr: nothing forbids it.
  const ForbiddenUse* forbids(Use use) const;
};

/// Files and plain servers, whose terms nobody can know here.
Terms unknown_terms(const std::string& provider);

/// Google Maps Platform, for Photorealistic 3D Tiles through the Map Tiles API.
Terms google_terms();

/// The user's own assets on Cesium ion, and others that it streams.
Terms cesium_ion_terms();

/// Throws InputError (one line: the use, the term, where to read it, what to do) where the terms forbid the use and
/// `accepted` is false. `source` stands in the message.
void require_permitted(const Terms& terms, Use use, bool accepted, const std::string& source);

}  // namespace tileflight::tiles
