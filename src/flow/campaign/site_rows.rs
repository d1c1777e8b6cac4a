//! Rows of one site.

use super::CampaignSite;
use crate::{
    body::Body,
    minus::signed,
    pds::image_index::IndexedImage,
    products::{GeometricProducts, ImageProducts, SiteProducts},
    stages::{
        check_heights::HeightCheck,
        check_profiles::LeftOutProfile,
        compare_pairs::PairComparison,
        group_profiles::Profile,
        pool_sites::{
            ImageGeometry, ImageRow, KernelSetName, OrientedImageRow, PairHeights, PairRow,
            PairState, PolynomialRmse, ProfileRow, RangeStatistics, SiteRow, SiteState,
            shot_spacing_m,
        },
        select_images::identifier,
    },
    store::manifest::Manifest,
};

/// The rows of a site.
pub(super) struct SiteRows {
    pub(super) site: SiteRow,
    pub(super) images: Vec<ImageRow>,
    pub(super) pairs: Vec<PairRow>,
    pub(super) profiles: Vec<ProfileRow>,
}

fn count(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// The rows of a site without usable products: the site with the reason, and its images as the index has them.
pub(super) fn without_products(
    site: &CampaignSite<'_>,
    state: SiteState,
    failure: String,
) -> SiteRows {
    let images = site.images.iter();
    let images: Vec<ImageRow> = images
        .map(|indexed| ImageRow {
            site: site.id.to_owned(),
            image: identifier(indexed),
            ..of_index(indexed)
        })
        .collect();
    let first = images.first();
    SiteRows {
        site: SiteRow {
            site: site.id.to_owned(),
            phase: first.map_or_else(String::new, |image| image.phase.clone()),
            state,
            verdict: "",
            is_valid: false,
            reasons: Vec::new(),
            remarks: Vec::new(),
            failure,
            body: Body::Mars,
            place_rad: first.and_then(|image| image.place_rad),
            images: count(images.len()),
            pairs: 0,
            profiles: 0,
            ties: 0,
            footprints: 0,
            kernels: KernelSetName::default(),
            configuration_blake3: String::new(),
            fingerprint: String::new(),
            version: String::new(),
        },
        images,
        pairs: Vec::new(),
        profiles: Vec::new(),
    }
}

/// What the index states of an image.
fn of_index(indexed: &IndexedImage) -> ImageRow {
    let [emission_rad, incidence_rad, _] = indexed.angles_rad;
    let [instrument, filter] = &indexed.instrument;
    ImageRow {
        phase: indexed.phase().to_owned(),
        orbit: indexed.orbit.as_ref().map(|(_, orbit)| *orbit),
        utc_start: indexed.utc_start.clone(),
        camera: format!("{instrument} {filter}").trim().to_owned(),
        summing: indexed.summing.map(Option::unwrap_or_default),
        exposure_s: indexed.exposure_s,
        emission_rad,
        incidence_rad,
        place_rad: indexed.centre_rad,
        ..ImageRow::default()
    }
}

/// The rows of a site from its products, which belong to `manifest`.
pub(super) fn of_published(
    site: &CampaignSite<'_>,
    manifest: &Manifest,
    products: &SiteProducts<'_>,
) -> SiteRows {
    let kernels = kernels_of(manifest);
    let outcome = Outcome {
        site: site.id,
        verdict: manifest.verdict.word(),
        is_valid: manifest.verdict.valid,
        kernels: &kernels,
    };
    let images: Vec<ImageRow> = (0..products.images.len())
        .map(|index| outcome.image(index, &site.images, products))
        .collect();
    let pairs = outcome.pairs(&images, products);
    let profiles = outcome.profiles(&images, products);
    let first = images.first();
    let ties = products.geometric.as_ref();
    let site = SiteRow {
        site: site.id.to_owned(),
        phase: first.map_or_else(String::new, |image| image.phase.clone()),
        state: SiteState::Published,
        verdict: outcome.verdict,
        is_valid: outcome.is_valid,
        reasons: manifest.verdict.reasons.clone(),
        remarks: manifest.verdict.remarks.clone(),
        failure: String::new(),
        body: products.config.body,
        place_rad: first
            .and_then(|image| image.place_rad)
            .or_else(|| first_footprint_rad(products)),
        images: count(images.len()),
        pairs: count(pairs.len()),
        profiles: count(profiles.len()),
        ties: ties.map_or(0, |geometric| count(geometric.ties.points.len())),
        footprints: count(products.footprints.len()),
        kernels: kernels.clone(),
        configuration_blake3: manifest.configuration.blake3.clone(),
        fingerprint: fingerprint(manifest),
        version: manifest.version.clone(),
    };
    SiteRows {
        site,
        images,
        pairs,
        profiles,
    }
}

fn first_footprint_rad(products: &SiteProducts<'_>) -> Option<[f64; 2]> {
    let footprints = products.footprints;
    (!footprints.is_empty()).then(|| {
        [
            footprints.longitude_rad.at(0),
            footprints.latitude_rad.at(0),
        ]
    })
}

/// The chosen set, or the SPK files in use, and a hash over all kernels that the site reads.
fn kernels_of(manifest: &Manifest) -> KernelSetName {
    let chosen = manifest.kernel_choice.iter().find(|set| set.chosen);
    let spk = manifest
        .kernels
        .iter()
        .filter(|kernel| kernel.role == "SPK" && !kernel.coverage_used.is_empty());
    let names = spk.map(|kernel| kernel.name.as_str()).collect::<Vec<_>>();
    let mut hasher = blake3::Hasher::new();
    for kernel in &manifest.kernels {
        // Orbits and attitudes that the site does not read do not matter; other roles have no coverage.
        if !matches!(&*kernel.role, "SPK" | "CK") || !kernel.coverage_used.is_empty() {
            hasher.update(format!("{} {}\n", kernel.role, kernel.blake3).as_bytes());
        }
    }
    KernelSetName {
        name: chosen.map_or_else(|| names.join(" "), |set| set.set.clone()),
        blake3: if manifest.kernels.is_empty() {
            String::new()
        } else {
            hasher.finalize().to_hex().to_string()
        },
    }
}

/// Hash over the fingerprints of all stages but the last: that one contains the place of the products.
fn fingerprint(manifest: &Manifest) -> String {
    let mut hasher = blake3::Hasher::new();
    let stages = manifest.stages.iter();
    for stage in stages.filter(|stage| stage.name != crate::flow::PUBLISH) {
        hasher.update(format!("{} {}\n", stage.name, stage.fingerprint).as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// What all rows of a site share.
struct Outcome<'a> {
    site: &'a str,
    verdict: &'static str,
    is_valid: bool,
    kernels: &'a KernelSetName,
}

impl Outcome<'_> {
    fn image(
        &self,
        index: usize,
        indexed: &[&IndexedImage],
        products: &SiteProducts<'_>,
    ) -> ImageRow {
        let ImageProducts {
            times,
            orientation,
            model,
            registration,
        } = products.images[index];
        let known = indexed
            .iter()
            .find(|indexed| identifier(indexed).eq_ignore_ascii_case(&times.id));
        let known = known.map_or_else(ImageRow::default, |indexed| of_index(indexed));
        let geometry = ImageGeometry::of(times, orientation);
        let simultaneous = simultaneous(products.profiles, index);
        let [points, inside] = [
            registration.profiles.iter().map(|of| of.points).sum(),
            registration.profiles.iter().map(|of| of.inside).sum(),
        ];
        ImageRow {
            site: self.site.to_owned(),
            verdict: self.verdict,
            is_valid: self.is_valid,
            is_repeated: false,
            image: times.id.clone(),
            utc_start: times.utc_start.clone(),
            camera: times.instrument.name.clone(),
            summing: [times.crosstrack_summing, times.downtrack_summing],
            exposure_s: Some(times.exposure_s),
            emission_rad: geometry.emission_rad.or(known.emission_rad),
            off_nadir_rad: geometry.off_nadir_rad,
            place_rad: geometry.place_rad.or(known.place_rad),
            oriented: Some(OrientedImageRow {
                lines: times.line_times.lines(),
                samples: times.samples,
                line_spacing_m: geometry.line_spacing_m,
                pixel_size_m: geometry.pixel_size_m,
                rmse: [&model.first_order, &model.second_order].map(PolynomialRmse::of),
                registered: points,
                inside,
                simultaneous: simultaneous.map_or_else(String::new, |(of, _)| of.id.clone()),
                simultaneous_shots: simultaneous.map_or(0, |(_, shots)| shots),
                shot_spacing_m: simultaneous
                    .and_then(|(of, _)| shot_spacing_m(products.footprints, of)),
                invalid_because: products.images[index].invalid_because().join("; "),
            }),
            ..known
        }
    }

    fn pairs(&self, images: &[ImageRow], products: &SiteProducts<'_>) -> Vec<PairRow> {
        let Some(geometric) = &products.geometric else {
            return Vec::new();
        };
        let rows = geometric.pairs.iter();
        rows.filter_map(|pair| self.pair(pair, images, geometric))
            .collect()
    }

    /// `None` for images that the site does not have, which does not occur.
    fn pair(
        &self,
        before: &PairComparison,
        images: &[ImageRow],
        geometric: &GeometricProducts<'_>,
    ) -> Option<PairRow> {
        let index = |id: &String| images.iter().position(|image| image.image == *id);
        let [first, second] = &before.images;
        let both = [index(first)?, index(second)?];
        let rows = both.map(|image| &images[image]);
        let heights = |check: &HeightCheck| PairHeights::of(check, geometric.ties, both);
        let after = geometric.adjustment.as_ref().and_then(|adjustment| {
            let mut pairs = adjustment.pairs.iter();
            let after = pairs.find(|after| after.images == before.images)?;
            Some(PairState::of(after, heights(adjustment.heights)))
        });
        let [line_m, other_m] = before.line_spacing_m;
        Some(PairRow {
            site: self.site.to_owned(),
            verdict: self.verdict,
            is_valid: self.is_valid,
            is_repeated: false,
            images: before.images.clone(),
            phases: rows.map(|image| image.phase.clone()),
            utc_start: rows.map(|image| image.utc_start.clone()),
            emission_rad: rows.map(|image| image.emission_rad),
            latitude_rad: rows[0].place_rad.map(|[_, latitude_rad]| latitude_rad),
            summing: rows.map(|image| image.summing[0]),
            convergence_rad: before.convergence_rad,
            height_over_base: before.height_over_base,
            pixel_size_m: f64::midpoint(line_m, other_m),
            shot_spacing_m: before.mola_spacing_m,
            clock_m_s: before.along_track.map(|of| of.clock_m_s),
            before: PairState::of(before, heights(geometric.heights)),
            after,
            budget: before.budget.clone(),
            kernels: self.kernels.clone(),
        })
    }

    fn profiles(&self, images: &[ImageRow], products: &SiteProducts<'_>) -> Vec<ProfileRow> {
        let ranges = products.profiles.iter().zip(&products.ranges.profiles);
        let rows = ranges.enumerate().map(|(index, (profile, ranges))| {
            let simultaneous = profile.simultaneous.iter().max_by_key(|of| of.shots);
            let image = simultaneous.map(|of| of.image);
            let in_image = image.and_then(|image| products.images.get(image));
            let in_image = in_image.map_or_else(RangeStatistics::default, |image| {
                RangeStatistics::in_image(products.ranges, index, image.registration)
            });
            let row = image.and_then(|image| images.get(image));
            let phase = row.or_else(|| images.first());
            let left_out = &products.profile_check.left_out;
            let left_out = left_out.iter().find(|of| of.profile == profile.id);
            let measured = ranges.measured() > 0;
            ProfileRow {
                site: self.site.to_owned(),
                verdict: self.verdict,
                is_valid: self.is_valid,
                is_repeated: false,
                phase: phase.map_or_else(String::new, |image| image.phase.clone()),
                profile: profile.id.clone(),
                orbit: profile.orbit,
                image: row.map_or_else(String::new, |image| image.image.clone()),
                off_nadir_rad: ranges.off_nadir_rad,
                ranges: RangeStatistics::of(&ranges.range_minus_distance_m),
                mean_without_outliers_m: ranges.mean_without_outliers_m,
                outliers: ranges.outliers,
                in_image,
                spacecraft_m: ranges.spacecraft_m.map(|of| of.mean),
                is_judged: measured && ranges.is_judged(&products.config.range_check),
                invalid_because: ranges.invalid_because.join("; "),
                rejected_because: left_out.map_or_else(String::new, rejected_because),
                kernels: self.kernels.clone(),
            }
        });
        rows.collect()
    }
}

/// The profile with the most shots during the exposure of an image, and their number.
fn simultaneous(profiles: &[Profile], image: usize) -> Option<(&Profile, u32)> {
    let of = profiles.iter().flat_map(|profile| {
        let own = profile
            .simultaneous
            .iter()
            .filter(move |of| of.image == image);
        own.map(move |of| (profile, of.shots))
    });
    of.max_by_key(|(_, shots)| *shots)
}

fn rejected_because(profile: &LeftOutProfile) -> String {
    let evidence = if profile.misplaced {
        format!("misplaced, misfit {:.1}", profile.misfit)
    } else {
        format!(
            "{} m above the profiles that it crosses",
            signed(profile.above_m, 1)
        )
    };
    format!("{evidence} ({} profiles)", profile.others.len())
}
