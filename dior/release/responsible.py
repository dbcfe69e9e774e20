"""What a user of a release has to know of its making and of the people in it, as Croissant's RAI extension says it.

INPUTS   the `release:` section of the config, the parts that the release has. OUTPUT: properties for croissant.json
Source: https://docs.mlcommons.org/croissant/docs/croissant-rai-spec.html, version 1.0
Only what dior knows of every release is said; what only the lab can know (who was asked, what the data must not be used
for) is in its licence and its own texts.
"""

from collections.abc import Collection
from typing import Any

from dior import __version__

COVERED = {
    "blurred": "heads are blurred",
    "pixelated": "heads are pixelated",
    "filled": "heads are filled with grey",
    "shown": "faces are as recorded",
}


def properties(release: dict[str, Any], parts: Collection[str], simulated: bool) -> dict[str, Any]:
    """The properties. `parts`: names of the tables that there are; `simulated`: whether the people do not exist."""
    found: dict[str, Any] = {
        "rai:dataCollection": "Simulated walks; the people in them do not exist."
        if simulated
        else "Walks recorded by calibrated cameras, some far away, and by motion capture where a walk was indoors.",
        "rai:dataCollectionType": ["Software Collection"] if simulated else ["Physical data collection"],
        "rai:dataCollectionMissingData": (
            "Missing values are null with a reason beside them (status, no_image); nothing is imputed. Labels that a "
            "check found wrong, and that nobody vouches for, have the status suspect and no coordinates."
        ),
        "rai:dataPreprocessingProtocol": [
            "The clock of each camera against the others is estimated, and is in its labels; stamps are as recorded."
            + (" They are shifted by one number for each person." if release["shift_stamps"] else ""),
            f"Pictures: {COVERED[release['faces']]}; only of people who agreed to pictures, others have none.",
            "Names are replaced by pseudonyms; who did not agree to the release is in no table and no count.",
        ],
        "rai:dataAnnotationProtocol": (
            "Labels are 3D joints projected into each camera at each picture's own stamp: markers of motion capture "
            "indoors, joints triangulated from detections of the close cameras outdoors. Each has the standard error "
            "that detections, poses and clocks leave open, null where it is not known."
        ),
        "rai:machineAnnotationTools": [f"dior {__version__}"],
        "rai:dataBiases": (
            "The people, places, cameras and clothes of the lab that recorded. Of a person only the pseudonym and, "
            "where known, the height are in the data, so that nothing can be said of results by other groups."
        ),
        "rai:dataLimitations": "README.md, under Limits; how good the labels are, under How good they are.",
        "rai:personalSensitiveInformation": []
        if simulated
        else [
            "Gait is a biometric trait: walks of one person can be told from those of others.",
            "Height, where it is given.",
            *(["Pictures of people who agreed to them."] if "frames" in parts else []),
        ],
        "rai:dataUseCases": "Pose estimation, gait analysis and gait recognition, also from far away.",
        "rai:dataReleaseMaintenancePlan": (
            "Versions are numbered. Where somebody withdraws, a new version without the person replaces this one; "
            "`dior diff` tells what changed."
        ),
    }
    return {key: value for key, value in found.items() if value}
