#pragma once

#include <string>
#include <vector>

namespace tileflight::fetch {

/// Uses of tiles that a provider's terms may restrict, beyond viewing them.
enum class Use {
  kAnalyse,  ///< machine analysis of rendered images (odometry, a dataset for it)
  kExtract,  ///< extraction of geometry (ground truth)
  kCache,    ///< storage on disk as far as HTTP allows
  kOffline,  ///< use of stored tiles without contacting the server
};

/// A use forbidden by a provider's terms, unless the user has another agreement.
struct ForbiddenUse {
  Use use;
  std::string term_text;  ///< short form of the term
  std::string url;        ///< where the term can be read
};

/// Terms of a source. An empty list of forbidden uses is not a licence: only known terms are listed.
struct TermsOfUse {
  std::string provider;  ///< "files", "example.org", "Google Photorealistic 3D Tiles", "Cesium ion"
  std::string url;       ///< where the terms can be read; empty: they are not known, ask the provider
  std::vector<ForbiddenUse> forbidden;

  /// Finds the prohibition of a use; nullptr if the use is not forbidden.
  const ForbiddenUse* find_prohibition(Use use) const;
};

/// Returns the terms of files and plain servers, which are not known.
TermsOfUse unknown_terms(const std::string& provider);

/// Returns the terms of Google Maps Platform for Photorealistic 3D Tiles through the Map Tiles API.
TermsOfUse google_terms();

/// Returns the terms of Cesium ion for the user's own assets and others that it streams.
TermsOfUse cesium_ion_terms();

/// Throws InputError (one line: the use, the term, where to read it, what to do) if the terms forbid the use and
/// `accepted` is false. `source` is named in the message.
void require_permitted(const TermsOfUse& terms, Use use, bool accepted, const std::string& source);

}  // namespace tileflight::fetch
